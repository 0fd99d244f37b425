# throng::options: what every target of this project is compiled with.
add_library(throng_options INTERFACE)
add_library(throng::options ALIAS throng_options)
target_compile_options(throng_options INTERFACE
  $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wno-unused-parameter>
  # What is drawn must not depend on the compiler's taste: only a written fma is fused.
  $<$<COMPILE_LANGUAGE:CXX>:-ffp-contract=off>)
# Vulkan-like clip space (z in [0, w]) in every projection that GLM makes.
target_compile_definitions(throng_options INTERFACE GLM_FORCE_DEPTH_ZERO_TO_ONE GLM_ENABLE_EXPERIMENTAL)

if(THRONG_SANITIZE STREQUAL "address")
  set(flags -fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer)
elseif(THRONG_SANITIZE STREQUAL "thread")
  set(flags -fsanitize=thread -fno-omit-frame-pointer)
elseif(NOT THRONG_SANITIZE STREQUAL "")
  message(FATAL_ERROR "THRONG_SANITIZE is '${THRONG_SANITIZE}', must be empty, address or thread")
endif()
if(flags)
  add_compile_options(${flags})
  add_link_options(${flags})
endif()

# A program needs the libraries that it calls, not those of all parts it is linked with.
add_link_options(-Wl,--as-needed)

find_program(THRONG_CCACHE ccache)
if(THRONG_CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${THRONG_CCACHE})
  set(CMAKE_CUDA_COMPILER_LAUNCHER ${THRONG_CCACHE})
endif()
