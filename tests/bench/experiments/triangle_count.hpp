#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <vector>

#include "throng/render/compute.hpp"
#include "throng/render/crowd.hpp"

namespace throng::bench {

/// How many triangles a vertex budget leads to in given views, without drawing them.
class TriangleCount {
 public:
  static absl::StatusOr<TriangleCount> make(std::shared_ptr<const render::Cast> cast,
                                            unsigned threads, const render::Viewport& viewport,
                                            render::LodRule rule, render::PoseMode pose);

  /// A view of the crowd at a time.
  absl::Status add(const render::Crowd& crowd, std::int64_t time_us, const render::Camera& camera);

  absl::StatusOr<double> mean_at(double budget_million);

  /// The budget, in millions, whose mean is closest to so many triangles.
  absl::StatusOr<double> budget_for(double triangles);

 private:
  TriangleCount() = default;
  std::unique_ptr<render::ComputeBackend> backend_;
  std::vector<std::unique_ptr<render::ViewWork>> views_;
  render::Viewport viewport_;
  render::Selection selection_;
};

}  // namespace throng::bench
