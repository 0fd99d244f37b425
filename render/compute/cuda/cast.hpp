#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <vector>

#include "render/compute/cpu/error_table.hpp"
#include "render/compute/cuda/device_types.hpp"
#include "render/compute/cuda/memory.hpp"
#include "throng/render/asset.hpp"

namespace throng::render::cuda {

/// The cast in device memory: every section of all characters in one array of its kind.
class CudaCast {
 public:
  /// Waits until all is there. InvalidArgument names the member and what it lacks.
  static absl::StatusOr<std::shared_ptr<const CudaCast>> upload(std::shared_ptr<const Cast> cast,
                                                                cudaStream_t stream);

  const DeviceCast& device() const { return device_; }
  const std::shared_ptr<const Cast>& cast() const { return cast_; }
  std::size_t character_count() const { return cast_->members.size(); }
  std::uint32_t most_joints() const { return most_joints_; }
  /// By character, in the host's memory.
  const std::vector<ErrorTable>& errors() const { return errors_; }
  const std::vector<bool>& may_share() const { return may_share_; }
  /// Of posed meshes that agents may share.
  std::uint32_t mesh_count() const { return mesh_count_; }

 private:
  explicit CudaCast(cudaStream_t stream)
      : character_(stream),
        vertex_(stream),
        uv_(stream),
        collapse_target_(stream),
        triangle_(stream),
        triangle_count_at_(stream),
        legal_count_(stream),
        palette_(stream),
        level_(stream),
        level_corners_(stream),
        level_at_(stream),
        error_count_(stream),
        point_(stream),
        point_radius_m_(stream),
        point_tone_(stream) {}

  std::shared_ptr<const Cast> cast_;
  DeviceCast device_;
  std::vector<ErrorTable> errors_;
  std::vector<bool> may_share_;
  std::uint32_t most_joints_ = 0, mesh_count_ = 0;
  DeviceBuffer<DeviceCharacter> character_;
  DeviceBuffer<element::SourceVertex> vertex_;
  DeviceBuffer<glm::u16vec2> uv_;
  DeviceBuffer<std::uint32_t> collapse_target_;
  DeviceBuffer<glm::uvec3> triangle_;
  DeviceBuffer<std::uint32_t> triangle_count_at_;
  DeviceBuffer<std::uint32_t> legal_count_;
  DeviceBuffer<element::JointMatrix> palette_;
  DeviceBuffer<DeviceLevel> level_;
  DeviceBuffer<std::uint32_t> level_corners_, level_at_, error_count_;
  DeviceBuffer<element::SourceVertex> point_;
  DeviceBuffer<float> point_radius_m_;
  DeviceBuffer<DevicePointTone> point_tone_;
};

}  // namespace throng::render::cuda
