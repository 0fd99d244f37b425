# THRONG_WITH_CUDA: true where the CUDA toolkit is found (THRONG_CUDA=AUTO) or asked for (ON).
set(THRONG_WITH_CUDA OFF)
# The sanitizers know nothing of device code, so AUTO leaves it out beside them.
if(NOT THRONG_CUDA STREQUAL "OFF" AND NOT (THRONG_CUDA STREQUAL "AUTO" AND THRONG_SANITIZE))
  include(CheckLanguage)
  check_language(CUDA)
  if(CMAKE_CUDA_COMPILER)
    set(THRONG_WITH_CUDA ON)
  elseif(THRONG_CUDA STREQUAL "ON")
    message(FATAL_ERROR "THRONG_CUDA is ON and no CUDA compiler was found (set CUDACXX)")
  endif()
endif()
message(STATUS "throng: CUDA ${THRONG_WITH_CUDA}")

# throng::cuda: how device code is compiled. What is drawn must not depend on the backend: only the
# fma that is written out is fused.
if(THRONG_WITH_CUDA)
  if(NOT CMAKE_CUDA_ARCHITECTURES)
    set(CMAKE_CUDA_ARCHITECTURES 75 90)
  endif()
  enable_language(CUDA)
  if(NOT CMAKE_CUDA20_STANDARD_COMPILE_OPTION)  # CMake 3.25 does not know that nvcc 12 and later do
    set(CMAKE_CUDA20_STANDARD_COMPILE_OPTION "-std=c++20")
    set(CMAKE_CUDA20_EXTENSION_COMPILE_OPTION "-std=c++20")
  endif()
  find_package(CUDAToolkit REQUIRED)
  # nvJPEG is looked for when the program runs. Its header is the toolkit's, that of the folder
  # THRONG_NVJPEG_INCLUDE, or of the nvidia-nvjpeg wheel, which pip is asked for once and which is
  # kept in the build folder (THRONG_NVJPEG_WHEEL=OFF: never). Without it libjpeg-turbo encodes all
  # pictures.
  option(THRONG_NVJPEG_WHEEL "ask pip for nvJPEG's header where the toolkit has none" ON)
  set(nvjpeg_folder ${CMAKE_BINARY_DIR}/nvjpeg)
  set(nvjpeg_hints ${CUDAToolkit_INCLUDE_DIRS}
    ${nvjpeg_folder}/nvidia/cu${CUDAToolkit_VERSION_MAJOR}/include)
  find_path(THRONG_NVJPEG_INCLUDE nvjpeg.h HINTS ${nvjpeg_hints})
  if(NOT THRONG_NVJPEG_INCLUDE AND THRONG_NVJPEG_WHEEL AND NOT THRONG_NVJPEG_TRIED)
    message(STATUS "throng: asking pip for the nvidia-nvjpeg wheel, once (THRONG_NVJPEG_WHEEL=OFF: not)")
    set(THRONG_NVJPEG_TRIED ON CACHE INTERNAL "asked pip for nvJPEG's header once")
    math(EXPR next_major "${CUDAToolkit_VERSION_MAJOR} + 1")
    execute_process(
      COMMAND python3 -m pip download -q --no-deps -d ${nvjpeg_folder}
        "nvidia-nvjpeg>=${CUDAToolkit_VERSION_MAJOR},<${next_major}"
      TIMEOUT 120 OUTPUT_QUIET ERROR_QUIET RESULT_VARIABLE failed)
    file(GLOB wheel ${nvjpeg_folder}/*.whl)
    if(wheel)
      file(ARCHIVE_EXTRACT INPUT ${wheel} DESTINATION ${nvjpeg_folder}
        PATTERNS "*/nvjpeg.h" "*/libnvjpeg.so*")
      file(REMOVE ${wheel})
    else()
      message(STATUS "throng: pip did not bring the wheel (${failed})")
    endif()
    find_path(THRONG_NVJPEG_INCLUDE nvjpeg.h HINTS ${nvjpeg_hints})
  endif()
  if(NOT THRONG_NVJPEG_INCLUDE)
    message(STATUS "throng: no nvjpeg.h: pictures on a GPU are encoded by libjpeg-turbo")
  endif()
  message(STATUS "throng: nvJPEG's header: ${THRONG_NVJPEG_INCLUDE}")

  add_library(throng_cuda_options INTERFACE)
  add_library(throng::cuda ALIAS throng_cuda_options)
  target_link_libraries(throng_cuda_options INTERFACE CUDA::cudart_static)
  target_compile_definitions(throng_cuda_options INTERFACE $<$<COMPILE_LANGUAGE:CUDA>:GLM_FORCE_CUDA>)
  target_compile_options(throng_cuda_options INTERFACE
    "$<$<COMPILE_LANGUAGE:CUDA>:SHELL:--fmad=false --expt-relaxed-constexpr --diag-suppress=20012 -include cuda.h>")
endif()
