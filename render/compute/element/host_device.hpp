#pragma once

#include <cmath>
#include <cstdint>

// Functions of one element (one agent, one instance, one vertex), shared by every backend.
//
// Rules: GLM only; explicit fma in one written order, and only operations that IEEE 754 rounds
// correctly (+ - * / sqrt fma floor and conversions), so each backend computes the same bits.
//
// On the processor they are always inlined, so that a loop compiled for a newer instruction set
// gets them in that instruction set.
#if defined(__CUDACC__)
#define THRONG_HOST_DEVICE __host__ __device__
#elif defined(__GNUC__)
#define THRONG_HOST_DEVICE __attribute__((always_inline))
#else
#define THRONG_HOST_DEVICE
#endif

namespace throng::render::element {

THRONG_HOST_DEVICE inline float fused(float a, float b, float c) {
#if defined(__CUDA_ARCH__)
  return __fmaf_rn(a, b, c);
#elif defined(__GNUC__)
  return __builtin_fmaf(a, b, c);
#else
  return std::fma(a, b, c);
#endif
}

}  // namespace throng::render::element
