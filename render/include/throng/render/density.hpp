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

  std::vector<glm::vec2> position_m;       // [U] mean of its agents
  std::vector<float> free_m2;              // [U] ground that each of its agents has for itself
  std::vector<std::uint32_t> vertex_of;    // [A] kNoVertex: absent, or nowhere (not finite)
  std::vector<std::uint32_t> first_agent;  // [U+1] into agents
  std::vector<std::uint32_t> agents;       // by vertex, rising within each
  float cell_m = 0.0F;
  std::uint32_t triangles =
      0;  // Delaunay polygons; more corners than three where four are on a circle

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
  std::vector<float> radius;  // [P] spheres of it around the first i + 1 points cover the cloud
  glm::vec3 base[4];          // linear colour of each region before tints
  float width = 0.25F;        // mean width of a metre's figure

  std::uint32_t count() const { return static_cast<std::uint32_t>(position.size()); }
};

/// InvalidArgument where no member of the cast has surface points.
absl::StatusOr<CrowdCloud> make_crowd_cloud(const Cast& cast, std::uint32_t count = 512);

/// What is known of the agents once they are there: size, and the colours that they wear. [A]
struct FarAgents {
  std::vector<float> height_m;
  std::vector<std::uint32_t> colors;  // [4 A] skin, hair, top, bottom; packed as Splat::base
};
FarAgents make_far_agents(const Cast& cast, const CrowdCloud& cloud, const Roster& roster);

/// How a crowd's points are shared out. kDensity: the paper's. kEqual: to everybody the same.
enum class PointShare { kDensity, kEqual };

struct FarView {
  glm::dvec3 eye_world{0.0};  // relative to nothing: the crowd's origin is subtracted
  glm::dvec3 origin_world{0.0};
  glm::mat4 clip_from_relative{1.0F};
  float px_per_tangent = 1.0F;  // pixels of a metre at a metre
};

/// An agent and how many points of the cloud it gets.
struct FarShare {
  std::uint32_t agent;
  std::uint32_t points;
  float radius_m;  // of its points
};

/// Shares a fixed budget of points among the crowd in view.
///
/// Vertices come by rising distance; each agent of a vertex gets the vertex's share of what is
/// left, in proportion to the pixels that can be seen of it: the projected figure, or less where
/// people stand so close that the ones in front cover it (a figure shows no more than its own free
/// space does from there). Shares under one point go to as many agents as there are points, chosen
/// by hash, and those points are larger. Nobody gets more points than show. The sum never exceeds
/// `budget`.
class FarPlan {
 public:
  /// @param budget  points, at least 1
  void make(const Triangulation& triangulation, const FarAgents& agents, const CrowdCloud& cloud,
            const FarView& view, std::uint64_t budget, PointShare share);

  std::span<const FarShare> shares() const { return shares_; }
  std::uint64_t points() const { return points_; }
  std::uint32_t visible() const { return visible_; }  // agents on vertices in view

 private:
  std::vector<FarShare> shares_;
  std::vector<std::uint64_t> order_;  // distance bits and vertex
  std::vector<float> weight_;         // by vertex
  std::uint64_t points_ = 0;
  std::uint32_t visible_ = 0;
};

/// Copies the prefix of the cloud that each agent's share says to where it stands, in its colours:
/// everything that one draw of the whole far crowd needs. Work depends on the points alone.
/// @param position_m   [A] offset from the crowd's origin
/// @param heading_rad  [A] NaN: +X
void generate_far(const FarPlan& plan, const FarAgents& agents, const CrowdCloud& cloud,
                  std::span<const glm::vec3> position_m, std::span<const float> heading_rad,
                  const FarView& view, WorkPool& pool, std::vector<Splat>& splats);

/// Triangulates in a thread of its own, the newest request first and not more often than told, so
/// that no frame waits. Thread safe.
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
