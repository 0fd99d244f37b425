#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <memory>

#include "render/compute/cuda/device_types.hpp"
#include "render/compute/cuda/memory.hpp"

namespace throng::render::cuda {

/// What far crowds are made of, in device memory: shapes, and the agents of a few crowds. Each is
/// copied when its version is a new one.
class FarStore {
 public:
  struct Shape {
    explicit Shape(cudaStream_t stream)
        : figure(stream), block(stream), position(stream), normal(stream), region(stream) {}
    std::uint64_t version = 0;
    DeviceBuffer<FarFigurePoint> figure;
    DeviceBuffer<std::uint32_t> block;
    DeviceBuffer<glm::vec3> position, normal;
    DeviceBuffer<std::uint8_t> region;
  };
  struct Agents {
    explicit Agents(cudaStream_t stream)
        : id(stream), height_m(stream), colors(stream), member(stream) {}
    std::uint64_t version = 0;
    DeviceBuffer<std::uint64_t> id;
    DeviceBuffer<float> height_m;
    DeviceBuffer<std::uint32_t> colors;
    DeviceBuffer<std::uint16_t> member;
  };

  absl::StatusOr<std::shared_ptr<const Shape>> shape(const FarPoints& far, cudaStream_t stream);
  absl::StatusOr<std::shared_ptr<const Agents>> agents(const FarPoints& far, cudaStream_t stream);
  void clear() { *this = FarStore(); }

 private:
  std::array<std::shared_ptr<const Shape>, 2> shapes_;   // figures, cloud
  std::array<std::shared_ptr<const Agents>, 4> agents_;  // as many crowds as FarCrowd remembers
  std::size_t next_agents_ = 0;
};

/// From the host's memory, which may be another's once this returns: what is not page-locked is
/// copied aside first.
template <typename T>
cudaError_t copy_far(std::span<const T> from, DeviceBuffer<T>& to, cudaStream_t stream) {
  const cudaError_t error = to.resize(from.size());
  if (error != cudaSuccess || from.empty()) return error;
  return cudaMemcpyAsync(to.data(), from.data(), from.size_bytes(), cudaMemcpyHostToDevice, stream);
}

}  // namespace throng::render::cuda
