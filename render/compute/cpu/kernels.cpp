#include "render/compute/cpu/kernels.hpp"

#include <cmath>
#include <cstring>

#include "render/compute/element/octahedral.hpp"

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define THRONG_X86_KERNELS 1
#include <immintrin.h>
#endif

namespace throng::render {

namespace plain {
namespace {

/// Four columns of a joint's matrix.
struct Lanes {
  float v[16];
  static Lanes all(float x) {
    Lanes result;
    for (float& lane : result.v) lane = x;
    return result;
  }
  static Lanes load(const float* from) {
    Lanes result;
    std::memcpy(result.v, from, sizeof result.v);
    return result;
  }
  static Lanes fma(const Lanes& a, const Lanes& b, const Lanes& c) {
    Lanes result;
    for (int k = 0; k < 16; ++k) result.v[k] = element::fused(a.v[k], b.v[k], c.v[k]);
    return result;
  }
  static Lanes sub(const Lanes& a, const Lanes& b) {
    Lanes result;
    for (int k = 0; k < 16; ++k) result.v[k] = a.v[k] - b.v[k];
    return result;
  }
  static Lanes mul(const Lanes& a, const Lanes& b) {
    Lanes result;
    for (int k = 0; k < 16; ++k) result.v[k] = a.v[k] * b.v[k];
    return result;
  }
};

/// Turns and scales a matrix into world axes.
struct Placed {
  explicit Placed(const element::Placement& with) : placement(with) {}
  void store(const Lanes& m, float* out) const { element::place_matrix(placement, m.v, out); }
  element::Placement placement;
};

#define THRONG_KERNEL_SIMD 0
#include "render/compute/cpu/kernels.inl"
#undef THRONG_KERNEL_SIMD

}  // namespace
}  // namespace plain

#if THRONG_X86_KERNELS

// What is included above is compiled for any processor; only functions written between push and pop
// use more, so nothing of it can leak into code that runs elsewhere.
#pragma GCC push_options
#pragma GCC target("arch=x86-64-v3")
namespace avx2 {
namespace {

struct Lanes {
  __m256 low, high;
  static Lanes all(float x) { return {_mm256_set1_ps(x), _mm256_set1_ps(x)}; }
  static Lanes load(const float* from) { return {_mm256_load_ps(from), _mm256_load_ps(from + 8)}; }
  static Lanes fma(const Lanes& a, const Lanes& b, const Lanes& c) {
    return {_mm256_fmadd_ps(a.low, b.low, c.low), _mm256_fmadd_ps(a.high, b.high, c.high)};
  }
  static Lanes sub(const Lanes& a, const Lanes& b) {
    return {_mm256_sub_ps(a.low, b.low), _mm256_sub_ps(a.high, b.high)};
  }
  static Lanes mul(const Lanes& a, const Lanes& b) {
    return {_mm256_mul_ps(a.low, b.low), _mm256_mul_ps(a.high, b.high)};
  }
  template <int Column>
  __m128 column() const {
    return _mm256_extractf128_ps(Column < 2 ? low : high, Column % 2);
  }
};

struct Placed {
  explicit Placed(const element::Placement& p)
      : straight(_mm256_setr_ps(p.cosine_scale, p.cosine_scale, p.scale, 0.0F, p.cosine_scale,
                                p.cosine_scale, p.scale, 0.0F)),
        crossed(_mm256_setr_ps(-p.sine_scale, p.sine_scale, 0.0F, 0.0F, -p.sine_scale, p.sine_scale,
                               0.0F, 0.0F)) {}
  __m256 half(__m256 m) const {
    constexpr int kSwapXy = _MM_SHUFFLE(3, 2, 0, 1);
    return _mm256_fmadd_ps(m, straight, _mm256_mul_ps(_mm256_permute_ps(m, kSwapXy), crossed));
  }
  void store(const Lanes& m, float* out) const {
    _mm256_store_ps(out, half(m.low));
    _mm256_store_ps(out + 8, half(m.high));
  }
  __m256 straight, crossed;
};

#define THRONG_KERNEL_SIMD 1
#include "render/compute/cpu/kernels.inl"

}  // namespace
}  // namespace avx2
#pragma GCC pop_options

// GCC 12 takes the placeholders inside its own intrinsics for variables that are not set.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC push_options
#pragma GCC target("arch=x86-64-v4")
namespace avx512 {
namespace {

struct Lanes {
  __m512 v;
  static Lanes all(float x) { return {_mm512_set1_ps(x)}; }
  static Lanes load(const float* from) { return {_mm512_load_ps(from)}; }
  static Lanes fma(const Lanes& a, const Lanes& b, const Lanes& c) {
    return {_mm512_fmadd_ps(a.v, b.v, c.v)};
  }
  static Lanes sub(const Lanes& a, const Lanes& b) { return {_mm512_sub_ps(a.v, b.v)}; }
  static Lanes mul(const Lanes& a, const Lanes& b) { return {_mm512_mul_ps(a.v, b.v)}; }
  template <int Column>
  __m128 column() const {
    return _mm512_extractf32x4_ps(v, Column);
  }
};

struct Placed {
  explicit Placed(const element::Placement& p)
      : straight(
            _mm512_broadcast_f32x4(_mm_setr_ps(p.cosine_scale, p.cosine_scale, p.scale, 0.0F))),
        crossed(_mm512_broadcast_f32x4(_mm_setr_ps(-p.sine_scale, p.sine_scale, 0.0F, 0.0F))) {}
  void store(const Lanes& m, float* out) const {
    constexpr int kSwapXy = _MM_SHUFFLE(3, 2, 0, 1);
    const __m512 swapped = _mm512_permute_ps(m.v, kSwapXy);
    _mm512_store_ps(out, _mm512_fmadd_ps(m.v, straight, _mm512_mul_ps(swapped, crossed)));
  }
  __m512 straight, crossed;
};

#include "render/compute/cpu/kernels.inl"
#undef THRONG_KERNEL_SIMD

}  // namespace
}  // namespace avx512
#pragma GCC pop_options
#pragma GCC diagnostic pop

KernelLevel best_kernel_level() {
  static const KernelLevel level = [] {
    __builtin_cpu_init();
    if (__builtin_cpu_supports("x86-64-v4")) return KernelLevel::kAvx512;
    if (__builtin_cpu_supports("x86-64-v3")) return KernelLevel::kAvx2;
    return KernelLevel::kPlain;
  }();
  return level;
}

const Kernels& kernels(KernelLevel level) {
  if (level > best_kernel_level()) level = best_kernel_level();
  if (level == KernelLevel::kAvx512) return avx512::kKernels;
  return level == KernelLevel::kAvx2 ? avx2::kKernels : plain::kKernels;
}

#else

KernelLevel best_kernel_level() { return KernelLevel::kPlain; }

const Kernels& kernels(KernelLevel) { return plain::kKernels; }

#endif

}  // namespace throng::render
