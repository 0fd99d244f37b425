#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "crowd_fixture.hpp"
#include "throng/render/compute.hpp"

namespace throng::test {

/// A backend with a crowd, driven stage by stage.
struct Stage {
  std::shared_ptr<const render::Cast> cast;
  std::unique_ptr<render::ComputeBackend> backend;
  std::unique_ptr<render::ViewWork> view;
  std::shared_ptr<const render::Instances> instances;
  render::Camera camera;
  render::Viewport viewport;

  explicit Stage(std::shared_ptr<const render::Cast> with_cast,
                 render::BackendKind kind = render::BackendKind::kCpu, unsigned threads = 2)
      : cast(std::move(with_cast)) {
    backend = render::make_backend(kind, threads).value();
    EXPECT_TRUE(backend->upload(cast).ok());
    view = backend->make_view().value();
    camera.eye_world = {0.0, -30.0, 15.0};
    camera.target_world = {0.0, 0.0, 0.0};
  }

  void advance(const render::Crowd& crowd, std::int64_t time_us, int channel = -1) {
    const render::Bracket bracket = crowd.bracket(time_us);
    const auto older = backend->upload(bracket.older);
    const auto newer = backend->upload(bracket.newer);
    ASSERT_TRUE(older.ok() && newer.ok());
    auto advanced = backend->advance(**older, **newer, time_us, crowd.settings(), channel, {});
    ASSERT_TRUE(advanced.ok()) << advanced.status();
    instances = *std::move(advanced);
  }

  void cull() {
    const absl::Status status = backend->cull(*view, instances, camera, viewport);
    ASSERT_TRUE(status.ok()) << status;
  }

  void select(const render::Selection& selection) {
    const absl::Status status = backend->select(*view, selection);
    ASSERT_TRUE(status.ok()) << status;
  }

  /// All that follows advance.
  void finish(const render::Selection& selection = {}) {
    cull();
    select(selection);
    const absl::Status allocated = backend->allocate(*view);
    ASSERT_TRUE(allocated.ok()) << allocated;
    const absl::Status generated = backend->generate(*view);
    ASSERT_TRUE(generated.ok()) << generated;
  }

  render::FrameGeometry geometry() const { return backend->geometry(*view); }
  render::ComputeCounters counters() const { return backend->counters(*view); }
};

/// A crowd of one frame with agents at these places, all facing +X.
inline std::unique_ptr<render::Crowd> standing_crowd(std::shared_ptr<const render::Cast> cast,
                                                     const std::vector<glm::vec3>& position_m,
                                                     render::CrowdSettings settings = {}) {
  auto crowd = std::make_unique<render::Crowd>(std::move(cast), std::move(settings));
  std::vector<std::uint64_t> ids(position_m.size());
  for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = i + 1;
  const absl::Status status = crowd->push(
      frame_at(0, members(ids), position_m, std::vector<float>(position_m.size(), 0.0F)));
  EXPECT_TRUE(status.ok()) << status;
  return crowd;
}

}  // namespace throng::test
