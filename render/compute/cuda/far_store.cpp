#include "render/compute/cuda/far_store.hpp"

#include <utility>

#include "throng/render/crowd.hpp"

namespace throng::render::cuda {
namespace {

constexpr char kCall[] = "allocate: the far crowd";

}  // namespace

absl::StatusOr<std::shared_ptr<const FarStore::Shape>> FarStore::shape(const FarPoints& far,
                                                                       cudaStream_t stream) {
  std::shared_ptr<const Shape>& kept = shapes_[far.figure.empty() ? 1 : 0];
  if (kept != nullptr && kept->version == far.shape_version) return kept;
  kept.reset();  // its memory first
  auto made = std::make_shared<Shape>(stream);
  made->version = far.shape_version;
  THRONG_CUDA_TRY(copy_far(far.figure, made->figure, stream), kCall);
  THRONG_CUDA_TRY(copy_far(far.block, made->block, stream), kCall);
  THRONG_CUDA_TRY(copy_far(far.cloud_position, made->position, stream), kCall);
  THRONG_CUDA_TRY(copy_far(far.cloud_normal, made->normal, stream), kCall);
  THRONG_CUDA_TRY(copy_far(far.cloud_region, made->region, stream), kCall);
  kept = std::move(made);
  return kept;
}

absl::StatusOr<std::shared_ptr<const FarStore::Agents>> FarStore::agents(const FarPoints& far,
                                                                         cudaStream_t stream) {
  for (const auto& kept : agents_) {
    if (kept != nullptr && kept->version == far.agents_version) return kept;
  }
  std::shared_ptr<const Agents>& kept = agents_[next_agents_];
  next_agents_ = (next_agents_ + 1) % agents_.size();
  kept.reset();
  auto made = std::make_shared<Agents>(stream);
  made->version = far.agents_version;
  THRONG_CUDA_TRY(copy_far<std::uint64_t>(far.roster->id, made->id, stream), kCall);
  THRONG_CUDA_TRY(copy_far(far.height_m, made->height_m, stream), kCall);
  THRONG_CUDA_TRY(copy_far(far.colors, made->colors, stream), kCall);
  THRONG_CUDA_TRY(copy_far(far.member, made->member, stream), kCall);
  kept = std::move(made);
  return kept;
}

}  // namespace throng::render::cuda
