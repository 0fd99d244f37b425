#include "bench/experiments/triangle_count.hpp"

namespace throng::bench {

absl::StatusOr<TriangleCount> TriangleCount::make(std::shared_ptr<const render::Cast> cast,
                                                  unsigned threads,
                                                  const render::Viewport& viewport,
                                                  render::LodRule rule, render::PoseMode pose) {
  TriangleCount count;
  count.viewport_ = viewport;
  count.selection_.rule = rule;
  count.selection_.pose_mode = pose;
  auto backend = render::make_backend(render::BackendKind::kCpu, threads);
  if (!backend.ok()) return backend.status();
  count.backend_ = *std::move(backend);
  if (auto status = count.backend_->upload(std::move(cast)); !status.ok()) return status;
  return count;
}

absl::Status TriangleCount::add(const render::Crowd& crowd, std::int64_t time_us,
                                const render::Camera& camera) {
  const render::Bracket bracket = crowd.bracket(time_us);
  auto older = backend_->upload(bracket.older);
  if (!older.ok()) return older.status();
  auto newer = backend_->upload(bracket.newer);
  if (!newer.ok()) return newer.status();
  auto instances = backend_->advance(**older, **newer, time_us, crowd.settings(), -1, {});
  if (!instances.ok()) return instances.status();
  auto view = backend_->make_view();
  if (!view.ok()) return view.status();
  if (auto status = backend_->cull(**view, *instances, camera, viewport_); !status.ok()) {
    return status;
  }
  views_.push_back(*std::move(view));
  return absl::OkStatus();
}

absl::StatusOr<double> TriangleCount::mean_at(double budget_million) {
  double sum = 0;
  for (const auto& view : views_) {
    selection_.vertex_budget = static_cast<std::uint64_t>(budget_million * 1e6);
    if (auto status = backend_->select(*view, selection_); !status.ok()) return status;
    sum += static_cast<double>(backend_->counters(*view).triangles);
  }
  return views_.empty() ? 0.0 : sum / static_cast<double>(views_.size());
}

absl::StatusOr<double> TriangleCount::budget_for(double triangles) {
  double low = 0.0, high = 200.0;
  for (int round = 0; round < 26; ++round) {
    const double middle = 0.5 * (low + high);
    const absl::StatusOr<double> mean = mean_at(middle);
    if (!mean.ok()) return mean.status();
    (*mean < triangles ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace throng::bench
