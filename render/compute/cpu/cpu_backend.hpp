#pragma once

#include <memory>

#include "render/compute/cpu/kernels.hpp"
#include "throng/render/compute.hpp"

namespace throng::render {

/// @param level  of the instruction set; the results are the same at every level.
std::unique_ptr<ComputeBackend> make_cpu_backend(unsigned threads,
                                                 KernelLevel level = best_kernel_level());

}  // namespace throng::render
