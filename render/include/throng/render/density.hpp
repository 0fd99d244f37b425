#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <mutex>
#include <span>
#include <stop_token>
#include <thread>
#include <vector>

#include "throng/render/asset.hpp"
#include "throng/render/camera.hpp"
#include "throng/render/crowd.hpp"
#include "throng/render/far_points.hpp"
#include "throng/render/vertex.hpp"

// Density based level of detail (Larkin, Paris, Dobbyn & O'Sullivan, "Every Last Detail"): a crowd
// so far away that its agents share one point cloud and one budget of points.
namespace throng::render {

class WorkPool;  // render/compute/cpu/work_pool.hpp

/// Free space of a crowd: the Delaunay triangulation of where agents stand.
///
/// Agents within one cell of a grid stand on one vertex (the paper's grouping) and share its
/// values. Shapes: A agents, U vertices.
struct Triangulation {
  static constexpr std::uint32_t kNoVertex = 0xffffffffU;

  std::vector<glm::vec3> position_m;       // [U] mean of its agents
  std::vector<float> free_m2;              // [U] ground that each of its agents has for itself
  std::vector<std::uint32_t> vertex_of;    // [A] kNoVertex: absent, or nowhere (not finite)
  std::vector<std::uint32_t> first_agent;  // [U+1] into agents
  std::vector<std::uint32_t> agents;       // by vertex, rising within each
  float cell_m = 0.0F;
  // Delaunay polygons; more corners than three where four are on a circle
  std::uint32_t triangles = 0;
  std::shared_ptr<const Roster> roster;  // whose slots these are; null: not told
  std::int64_t time_us = 0;              // of the snapshot, where it is told

  std::uint32_t vertex_count() const { return static_cast<std::uint32_t>(position_m.size()); }
};

struct TriangulationOptions {
  float cell_m = 0.25F;                  // doubled until the vertices are few enough
  std::uint32_t most_vertices = 60'000;  // bounds what an update costs
  float most_free_m2 = 25.0F;            // of those who stand alone, or on the crowd's border
};

/// Triangulates the agents of a crowd by the Voronoi diagram of Boost.Polygon (Fortune's sweep).
///
/// A vertex has an equal share of every Delaunay polygon that it is a corner of; at the border,
/// where polygons end, as much as if they went all round. Vertices without polygon (all on one
/// line) have the square of the distance to their neighbours. Never fails: positions that are not
/// finite get no vertex, and those beyond 1e7 m neither.
/// @param position_m  [A]
/// @param present     [A] 0: left out; empty: all are there
Triangulation triangulate(std::span<const glm::vec3> position_m,
                          std::span<const std::uint8_t> present,
                          const TriangulationOptions& options = {});

/// One cloud for all characters: their shapes' average, a metre high, feet at the origin, facing
/// +X. Points are in the order of importance: nearest neighbours were removed one after the other,
/// and who stayed longest comes first.
struct CrowdCloud {
  std::vector<glm::vec3> position;   // [P] of a metre's figure
  std::vector<glm::vec3> normal;     // [P]
  std::vector<std::uint8_t> region;  // [P] skin, hair, top, bottom (0..3)
  // [P] discs of it around the first i + 1 points are seen as large as the figure
  std::vector<float> radius;
  glm::vec3 base[4];    // linear colour of each region before tints
  float width = 0.25F;  // mean width of a metre's figure

  std::uint32_t count() const { return static_cast<std::uint32_t>(position.size()); }
};

/// InvalidArgument where no member of the cast has surface points.
absl::StatusOr<CrowdCloud> make_crowd_cloud(const Cast& cast, std::uint32_t count = 512);

/// The single characters in poses of theirs, and each of these as so many points: beyond the paper,
/// whose crowd has one shape. A level's points are means over the surface that is nearest to each
/// (Lloyd 1982), in colour, too, and together they are seen as large as the figure.
struct FarFigures {
  static constexpr std::uint32_t kCounts[] = {1,  2,  3,  4,  6,   8,   12,  16,  24,
                                              32, 48, 64, 96, 128, 192, 256, 384, 512};
  static constexpr std::uint32_t kLevels = 18, kPointsOfAll = 1788;  // their sum
  static constexpr std::uint32_t kPhases = 8;                        // of a walk
  static constexpr std::uint32_t kPoses = 1 + kPhases;               // the first one stands

  using Point = FarFigurePoint;

  static constexpr std::uint32_t kNobody = 0;
  static constexpr std::uint32_t kMostMembers = 256;  // 165 MB

  // [1 + members made][kPoses][kPointsOfAll]; the first ones are nowhere: of who has no surface
  std::vector<Point> points;
  std::vector<std::uint32_t> block;  // [members] of points

  /// Which of kCounts is the largest with at most so many points (at least 1).
  static std::uint32_t level_of(std::uint32_t points);
  const Point* level(std::uint32_t member, std::uint32_t pose, std::uint32_t level) const;
};

/// InvalidArgument where no member of the cast has surface points; members without are empty.
absl::StatusOr<FarFigures> make_far_figures(const Cast& cast);

/// Figures of nobody yet. InvalidArgument where no member of the cast has surface points.
absl::StatusOr<FarFigures> begin_far_figures(const Cast& cast);

/// Makes the figures of those members that occur and are not made yet: 643 KB and a few tens of
/// milliseconds each. Beyond `most_members` who comes takes the figure of one that is there, in his
/// own height and colours.
/// @param members  of the cast, any number of times
void add_far_figures(const Cast& cast, std::span<const std::uint16_t> members, FarFigures& figures,
                     std::uint32_t most_members = FarFigures::kMostMembers);

/// What is known of the agents once they are there: size, and the colours that they wear. [A]
struct FarAgents {
  std::vector<float> height_m;
  std::vector<std::uint32_t> colors;  // [4 A] skin, hair, top, bottom; packed as Splat::base
  std::vector<std::uint32_t> tints;   // [4 A] before they meet a base: element::pack_tint
  std::vector<std::uint16_t> member;  // of the cast
};
FarAgents make_far_agents(const Cast& cast, const CrowdCloud& cloud, const Roster& roster);

/// How a crowd's points are shared out. kDensity: the paper's. kEqual: to everybody the same.
/// kVisible, beyond the paper: by how much of each can be seen past those who are nearer.
enum class PointShare { kDensity, kEqual, kVisible };

struct FarRule {
  PointShare share = PointShare::kDensity;
  bool figures = false;  // numbers of points as FarFigures has them, not any
};

struct FarView {
  glm::dvec3 eye_world{0.0};  // relative to nothing: the crowd's origin is subtracted
  glm::dvec3 origin_world{0.0};
  glm::mat4 clip_from_relative{1.0F};
  float px_per_tangent = 1.0F;  // pixels of a metre at a metre
  float least_m = 0.0F;         // who is nearer to the eye is drawn as something else
  float walked_m = 2.0F;        // how far agents may be from where they were triangulated
  bool operator==(const FarView&) const = default;
};
FarView make_far_view(const Camera& camera, const Viewport& viewport,
                      const glm::dvec3& origin_world);

/// Shares a fixed budget of points among the crowd in view.
///
/// Vertices come by rising distance; each agent of a vertex gets the vertex's share of what is
/// left, in proportion to the pixels that can be seen of it: the projected figure, or less where
/// people stand so close that the ones in front cover it (a figure shows no more than its own free
/// space does from there). Shares under one point go to as many agents as there are points, chosen
/// by hash, and those points are larger. Nobody gets more points than show. The sum never exceeds
/// `budget`.
///
/// kVisible keeps how much of the picture those so far leave open, in cells, and counts of each
/// figure what lies in the open; who is behind others gets none.
class FarPlan {
 public:
  /// @param budget  points; InvalidArgument for none
  absl::Status make(const Triangulation& triangulation, const FarAgents& agents,
                    const CrowdCloud& cloud, const FarView& view, std::uint64_t budget,
                    const FarRule& rule);

  std::span<const FarShare> shares() const { return shares_; }
  std::uint64_t points() const { return points_; }
  std::uint32_t visible() const { return visible_; }  // agents on vertices in view

 private:
  void collect(const Triangulation& triangulation, const FarAgents& agents, const CrowdCloud& cloud,
               const FarView& view, PointShare share);
  void hide(const Triangulation& triangulation, const FarAgents& agents, const CrowdCloud& cloud,
            const FarView& view);

  std::vector<FarShare> shares_;
  std::vector<std::uint64_t> order_;  // distance bits and vertex
  std::vector<float> weight_;         // by vertex
  std::vector<float> open_;           // by cell of the picture: share that nobody covers yet
  double rest_weight_ = 0.0;
  std::uint64_t points_ = 0;
  std::uint32_t visible_ = 0;
};

/// Where an agent with a share is at the moment, and how it walks.
struct FarPlace {
  glm::vec3 position_m;  // offset from the crowd's origin
  float heading_rad;
  std::uint32_t pose;     // of FarFigures
  std::uint32_t visible;  // 0: not there, or nearer than FarView::least_m
};

/// Places the agents of a plan's shares: as `advance` does, and therefore where a mesh would be.
/// @param roster  that the plan's agents are of: who has gone since is not visible
void place_far(const FarPlan& plan, const Cast& cast, const Roster* roster, const Bracket& bracket,
               std::int64_t scene_time_us, const CrowdSettings& settings, const FarView& view,
               WorkPool& pool, std::vector<FarPlace>& places);

/// Copies the prefix of the cloud that each agent's share says to where it stands, in its colours:
/// everything that one draw of the whole far crowd needs. Work depends on the points alone.
/// @param places  by share
void generate_far(const FarPlan& plan, const FarAgents& agents, const CrowdCloud& cloud,
                  std::span<const FarPlace> places, const FarView& view, WorkPool& pool,
                  std::vector<Splat>& splats);

/// The same with the points of each one's own figure, of a plan made for them.
void generate_far(const FarPlan& plan, const FarAgents& agents, const FarFigures& figures,
                  std::span<const FarPlace> places, const FarView& view, WorkPool& pool,
                  std::vector<Splat>& splats);

/// Triangulates in a thread of its own, the newest request first and not more often than told nor
/// for more than a tenth of the time, so that no frame waits. Thread safe.
class TriangulationWorker {
 public:
  explicit TriangulationWorker(std::chrono::milliseconds least_interval,
                               TriangulationOptions options = {});
  ~TriangulationWorker();

  /// Asks for the triangulation of a snapshot; one that was not begun is replaced.
  void request(std::shared_ptr<const Snapshot> snapshot);

  /// The newest there is, or null. Its columns are by slot of the snapshot it was made of.
  std::shared_ptr<const Triangulation> newest() const;

  /// Waits until everything that was asked for is done. For tests and tools.
  void wait() const;

 private:
  void run(const std::stop_token& stop);

  const std::chrono::milliseconds least_interval_;
  const TriangulationOptions options_;
  mutable std::mutex mutex_;
  mutable std::condition_variable_any changed_;
  std::shared_ptr<const Snapshot> wanted_;
  bool busy_ = false;
  std::shared_ptr<const Triangulation> newest_;
  std::jthread thread_;
};

}  // namespace throng::render
