#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "throng/render/density.hpp"
#include "throng/render/representation.hpp"

namespace throng::render {

struct FarCounters {
  std::uint32_t visible = 0;  // agents in view that are far
  std::uint32_t drawn = 0;    // of them, who has points
};

/// The far crowd of a frame, for whatever crowd it is asked for: triangulated off the thread that
/// draws, at a bounded rate, or with FarSettings::wait at every half second of scene time, so that
/// a picture depends on nothing but its moment. Used by one thread at a time.
class FarCrowd {
 public:
  /// InvalidArgument where no member of the cast has surface points.
  /// @param threads  0: one for each core
  static absl::StatusOr<std::unique_ptr<FarCrowd>> make(std::shared_ptr<const Cast> cast,
                                                        unsigned threads);
  ~FarCrowd();

  /// Who is nearer to the eye than this is not part of it.
  static float distance_m(const FarSettings& settings, float px_per_tangent);

  /// The splats of everybody in view beyond view.least_m. InvalidArgument for a budget of 0.
  /// Someone who came since the last triangulation is not among them yet.
  /// @param shadows  feet and height of everybody who has points.
  absl::Status generate(const Crowd& crowd, std::int64_t scene_time_us, FarView view,
                        const FarSettings& settings, std::vector<Splat>& splats,
                        std::vector<Speck>& shadows, FarCounters& counters);

  /// The same up to who gets how many points, for a backend that makes them (ViewWork::far). Valid
  /// until the next call; without shares where nobody is far. counters.drawn is not known yet.
  absl::StatusOr<const FarPoints*> plan(const Crowd& crowd, std::int64_t scene_time_us,
                                        FarView view, const FarSettings& settings,
                                        FarCounters& counters);

 private:
  struct Entry;  // of one crowd
  /// Makes plan_ for what comes first in entries_, unless it is there. Null: nobody ever came.
  absl::StatusOr<std::shared_ptr<const Triangulation>> make_plan(const Crowd& crowd,
                                                                 const Bracket& bracket,
                                                                 std::int64_t scene_time_us,
                                                                 FarView& view,
                                                                 const FarSettings& settings);
  FarCrowd(std::shared_ptr<const Cast> cast, CrowdCloud cloud, FarFigures figures,
           unsigned threads);
  std::shared_ptr<const Triangulation> triangulation_of(Entry& entry, const Crowd& crowd,
                                                        const Bracket& bracket,
                                                        std::int64_t scene_time_us, bool wait);

  std::shared_ptr<const Cast> cast_;
  CrowdCloud cloud_;
  FarFigures figures_;
  std::unique_ptr<WorkPool> pool_;
  std::vector<std::unique_ptr<Entry>> entries_;  // newest use first
  FarPlan plan_;
  // what the plan is for: the same triangulation is of the same crowd
  struct Planned {
    std::shared_ptr<const Triangulation> triangulation;
    FarView view;
    std::uint64_t points = 0;
    bool published = false;
    bool operator==(const Planned&) const = default;
  };
  Planned planned_;
  std::uint64_t plan_version_ = 0, shape_version_ = 0, cloud_version_;
  FarPoints points_;
  std::vector<FarPlace> places_;
};

}  // namespace throng::render
