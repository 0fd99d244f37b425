// A crowd that Detour steers, published live: people walk to and fro in a hall with two pillars.
//
//   detour_crowd [URL [SECONDS [AGENTS [fast]]]]     localhost:7447, 60 s, 200, in real time
#include <DetourCrowd.h>
#include <DetourNavMesh.h>
#include <DetourNavMeshBuilder.h>
#include <DetourNavMeshQuery.h>
#include <Recast.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "throng/client/producer.hpp"

namespace {

constexpr int kLengthM = 40, kWidthM = 20;
constexpr float kStepS = 0.05F, kRadiusM = 0.25F;
// The same floor for throng, which has +Z up: Detour's (x, y up, z) is (x, -z, y) there.
constexpr char kWalkableArea[] =
    "POLYGON ((0 0, 40 0, 40 -20, 0 -20, 0 0), (18 -4, 22 -4, 22 -7, 18 -7, 18 -4), "
    "(18 -13, 22 -13, 22 -16, 18 -16, 18 -13))";

bool is_pillar(int x, int z) {
  return x >= 18 && x < 22 && ((z >= 4 && z < 7) || (z >= 13 && z < 16));
}

template <typename T>
using Owned = std::unique_ptr<T, void (*)(T*)>;

/// Recast's usual way from triangles to a mesh to walk on. Null when a step of it fails.
Owned<dtNavMesh> make_nav_mesh() {
  Owned<dtNavMesh> none(nullptr, dtFreeNavMesh);
  std::vector<float> corners;
  std::vector<int> triangles;
  for (int z = 0; z < kWidthM; ++z) {
    for (int x = 0; x < kLengthM; ++x) {
      if (is_pillar(x, z)) continue;
      const int first = static_cast<int>(corners.size() / 3);
      for (const auto& [dx, dz] : {std::pair{0, 0}, {0, 1}, {1, 1}, {1, 0}}) {
        corners.insert(corners.end(),
                       {static_cast<float>(x + dx), 0.0F, static_cast<float>(z + dz)});
      }
      triangles.insert(triangles.end(), {first, first + 1, first + 2, first, first + 2, first + 3});
    }
  }

  rcContext context(false);
  const float cell_m = 0.2F;
  const int height = 10, climb = 2, radius = 2;  // in cells
  const float low[3] = {0, -1, 0}, high[3] = {kLengthM, 3, kWidthM};
  int width = 0, depth = 0;
  rcCalcGridSize(low, high, cell_m, &width, &depth);
  Owned<rcHeightfield> field(rcAllocHeightfield(), rcFreeHeightField);
  Owned<rcCompactHeightfield> compact(rcAllocCompactHeightfield(), rcFreeCompactHeightfield);
  Owned<rcContourSet> contours(rcAllocContourSet(), rcFreeContourSet);
  Owned<rcPolyMesh> polygons(rcAllocPolyMesh(), rcFreePolyMesh);
  const int triangle_count = static_cast<int>(triangles.size() / 3);
  const std::vector<unsigned char> areas(triangles.size() / 3, RC_WALKABLE_AREA);
  const bool is_made =
      rcCreateHeightfield(&context, *field, width, depth, low, high, cell_m, cell_m) &&
      rcRasterizeTriangles(&context, corners.data(), static_cast<int>(corners.size() / 3),
                           triangles.data(), areas.data(), triangle_count, *field, climb) &&
      rcBuildCompactHeightfield(&context, height, climb, *field, *compact) &&
      rcErodeWalkableArea(&context, radius, *compact) && rcBuildDistanceField(&context, *compact) &&
      rcBuildRegions(&context, *compact, 0, 8, 20) &&
      rcBuildContours(&context, *compact, 1.3F, 60, *contours) &&
      rcBuildPolyMesh(&context, *contours, 6, *polygons);
  if (!is_made) return none;
  for (int i = 0; i < polygons->npolys; ++i) polygons->flags[i] = 1;

  dtNavMeshCreateParams parameters{};
  parameters.verts = polygons->verts;
  parameters.vertCount = polygons->nverts;
  parameters.polys = polygons->polys;
  parameters.polyAreas = polygons->areas;
  parameters.polyFlags = polygons->flags;
  parameters.polyCount = polygons->npolys;
  parameters.nvp = polygons->nvp;
  parameters.walkableHeight = 2.0F;
  parameters.walkableRadius = kRadiusM;
  parameters.walkableClimb = 0.4F;
  rcVcopy(parameters.bmin, polygons->bmin);
  rcVcopy(parameters.bmax, polygons->bmax);
  parameters.cs = parameters.ch = cell_m;
  parameters.buildBvTree = true;
  unsigned char* data = nullptr;
  int size = 0;
  if (!dtCreateNavMeshData(&parameters, &data, &size)) return none;
  Owned<dtNavMesh> mesh(dtAllocNavMesh(), dtFreeNavMesh);
  if (dtStatusFailed(mesh->init(data, size, DT_TILE_FREE_DATA))) return none;
  return mesh;
}

/// Sends an agent to a place on the mesh near a point.
void send_to(dtCrowd& crowd, int agent, float x, float z) {
  const float near[3] = {x, 0, z}, extents[3] = {2, 2, 2};
  dtPolyRef polygon = 0;
  float place[3];
  crowd.getNavMeshQuery()->findNearestPoly(near, extents, crowd.getFilter(0), &polygon, place);
  if (polygon != 0) crowd.requestMoveTarget(agent, polygon, place);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string url = argc > 1 ? argv[1] : "localhost:7447";
  const double seconds = argc > 2 ? std::atof(argv[2]) : 60.0;
  const int agents = argc > 3 ? std::atoi(argv[3]) : 200;
  const bool is_fast = argc > 4;

  const Owned<dtNavMesh> mesh = make_nav_mesh();
  const Owned<dtCrowd> crowd(dtAllocCrowd(), dtFreeCrowd);
  if (mesh == nullptr || agents < 1 || !crowd->init(agents, kRadiusM, mesh.get())) {
    std::fprintf(stderr, "detour_crowd: no mesh or no crowd\n");
    return 1;
  }
  std::mt19937 random(1);
  std::uniform_real_distribution<float> along(1.0F, 16.0F), across(1.0F, kWidthM - 1.0F),
      speed(1.0F, 1.6F);
  std::vector<std::uint8_t> goes_right;
  for (int i = 0; i < agents; ++i) {
    goes_right.push_back(i % 2 == 0);
    dtCrowdAgentParams parameters{};
    parameters.radius = kRadiusM;
    parameters.height = 1.8F;
    parameters.maxAcceleration = 8.0F;
    parameters.maxSpeed = speed(random);
    parameters.collisionQueryRange = 12 * kRadiusM;
    parameters.pathOptimizationRange = 30 * kRadiusM;
    parameters.separationWeight = 2.0F;
    parameters.obstacleAvoidanceType = 3;
    parameters.updateFlags = DT_CROWD_ANTICIPATE_TURNS | DT_CROWD_OBSTACLE_AVOIDANCE |
                             DT_CROWD_SEPARATION | DT_CROWD_OPTIMIZE_VIS | DT_CROWD_OPTIMIZE_TOPO;
    const float x = along(random);
    const float place[3] = {i % 2 == 0 ? x : kLengthM - x, 0, across(random)};
    crowd->addAgent(place, &parameters);
  }

  throng::client::ProducerOptions options;
  options.producer = "Detour";
  options.expected_rate_hz = 1.0 / kStepS;
  options.channels = {"speed"};
  options.units = {"m/s"};
  options.walkable_area_wkt = kWalkableArea;
  options.queue_frames = 64;
  const auto producer = throng::client::Producer::connect(url, "detour", options);

  const auto began = std::chrono::steady_clock::now();
  std::vector<std::uint64_t> ids(agents);
  for (int i = 0; i < agents; ++i) ids[i] = static_cast<std::uint64_t>(i) + 1;
  std::vector<double> positions(3 * ids.size());
  std::vector<float> speeds(ids.size());
  for (int step = 0; step * kStepS < seconds; ++step) {
    for (int i = 0; i < agents; ++i) {
      const dtCrowdAgent& agent = *crowd->getAgent(i);
      const bool is_there = goes_right[i] ? agent.npos[0] > kLengthM - 4 : agent.npos[0] < 4;
      if (step > 0 && !is_there) continue;
      if (is_there) goes_right[i] = !goes_right[i];
      send_to(*crowd, i, goes_right[i] ? kLengthM - 1.5F : 1.5F, across(random));
    }
    crowd->update(kStepS, nullptr);
    for (int i = 0; i < agents; ++i) {
      const dtCrowdAgent& agent = *crowd->getAgent(i);
      positions[3 * i] = agent.npos[0];
      positions[3 * i + 1] = -agent.npos[2];
      positions[3 * i + 2] = 0.0;  // the mesh lies a little above the floor
      speeds[i] = std::hypot(agent.vel[0], agent.vel[2]);
    }
    const std::span<const float> channels[] = {speeds};
    producer->publish(std::int64_t{step} * 50'000, ids, positions, {}, channels);
    if (!is_fast) {
      std::this_thread::sleep_until(began + std::chrono::milliseconds(50 * (step + 1)));
    } else if (step % 32 == 0) {
      // So that nothing is dropped; a simulation that runs in real time never waits.
      (void)producer->flush(std::chrono::seconds(10));
    }
  }
  const absl::Status flushed = producer->flush(std::chrono::seconds(10));
  const throng::client::ProducerStats stats = producer->stats();
  std::printf("%d agents, %llu frames published, %llu applied, %llu dropped\n", agents,
              static_cast<unsigned long long>(stats.published),
              static_cast<unsigned long long>(stats.applied),
              static_cast<unsigned long long>(stats.dropped));
  if (flushed.ok()) return 0;
  std::fprintf(stderr, "detour_crowd: %s\n", std::string(flushed.message()).c_str());
  return 1;
}
