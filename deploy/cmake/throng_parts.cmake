# throng_add_part(DIR): a sub-folder that is a part of its own. throng_add_test: one gtest program.
include_guard()

macro(throng_add_part dir)
  if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/${dir}/CMakeLists.txt)
    add_subdirectory(${dir})
  endif()
endmacro()

# throng_add_test(NAME SOURCES a.cpp ... [LIBS lib ...] [LEAF])
# LEAF: a reader or codec; deploy/test runs it under the address and undefined behaviour sanitizers too.
function(throng_add_test name)
  cmake_parse_arguments(arg "LEAF" "" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE ${arg_LIBS} throng::options GTest::gtest GTest::gmock GTest::gtest_main)
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/tests)
  target_compile_definitions(${name} PRIVATE
    THRONG_SOURCE_DIR="${PROJECT_SOURCE_DIR}" THRONG_BINARY_DIR="${PROJECT_BINARY_DIR}")
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  add_test(NAME ${name} COMMAND ${name}
    --gtest_output=json:${PROJECT_BINARY_DIR}/test-results/${name}.json)
  # as render::prepare_gpu does for programs
  set_tests_properties(${name} PROPERTIES ENVIRONMENT CUDA_MODULE_LOADING=EAGER)
  if(arg_LEAF)
    set_tests_properties(${name} PROPERTIES LABELS leaf)
    add_dependencies(throng_leaf_tests ${name})
  endif()
  add_dependencies(throng_tests ${name})
endfunction()
