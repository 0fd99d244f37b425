#pragma once

#include <memory>

#include "throng/render/compute.hpp"

namespace throng::render {

std::unique_ptr<ComputeBackend> make_cpu_backend(unsigned threads);

}  // namespace throng::render
