#include "bench/experiments/raster_case.hpp"

#include <absl/strings/str_cat.h>

#include "bench/experiments/table.hpp"

namespace throng::bench {
namespace {

constexpr float kPxM = 0.01F;
constexpr float kNearestM = 10.0F, kFarthestM = 90.0F;

/// Latitudes and longitudes: a vertex at each pole, `rings - 1` circles of `sides` between them.
void add_ellipsoid(RasterScene& scene, const glm::vec3& centre, const glm::vec3& radius,
                   float turn_rad, const RasterCase& one) {
  const auto add = [&](float latitude, float longitude) {
    const glm::vec3 unit(std::cos(latitude) * std::cos(longitude),
                         std::cos(latitude) * std::sin(longitude), std::sin(latitude));
    // trousers below, then a top, a face and hair
    const test::Region region = unit.z < -0.1F  ? test::Region::kBottom
                                : unit.z < 0.6F ? test::Region::kTop
                                : unit.z < 0.9F ? test::Region::kSkin
                                                : test::Region::kHair;
    return scene.add_vertex(centre + unit * radius, glm::normalize(unit / radius),
                            test::region_uv(region));
  };
  constexpr float kHalfTurn = 3.1415927F;
  const std::uint32_t south = add(-0.5F * kHalfTurn, 0.0F);
  for (std::uint32_t ring = 1; ring < one.rings; ++ring) {
    const float latitude =
        kHalfTurn * (static_cast<float>(ring) / static_cast<float>(one.rings) - 0.5F);
    for (std::uint32_t side = 0; side < one.sides; ++side) {
      add(latitude,
          turn_rad + 2.0F * kHalfTurn * static_cast<float>(side) / static_cast<float>(one.sides));
    }
  }
  const std::uint32_t north = add(0.5F * kHalfTurn, 0.0F);
  const auto at = [&](std::uint32_t ring, std::uint32_t side) {
    return south + 1 + (ring - 1) * one.sides + side % one.sides;
  };
  for (std::uint32_t side = 0; side < one.sides; ++side) {
    scene.add_triangle(south, at(1, side + 1), at(1, side));
    for (std::uint32_t ring = 1; ring + 1 < one.rings; ++ring) {
      scene.add_triangle(at(ring, side), at(ring, side + 1), at(ring + 1, side + 1));
      scene.add_triangle(at(ring, side), at(ring + 1, side + 1), at(ring + 1, side));
    }
    scene.add_triangle(at(one.rings - 1, side), at(one.rings - 1, side + 1), north);
  }
}

}  // namespace

std::string RasterCase::name() const {
  return absl::StrCat(grouped(instances), " x ", grouped(triangles()), ", ", height_px, " px");
}

render::Camera raster_camera(const render::Viewport& viewport) {
  render::Camera camera;
  camera.eye_world = {0.0, 0.0, 0.0};
  camera.target_world = {0.0, 1.0, 0.0};
  camera.ortho_height_m = kPxM * viewport.height_px;
  camera.near_m = 1.0;
  camera.far_m = 100.0;
  return camera;
}

RasterScene raster_scene(const RasterCase& one, const render::Camera& camera,
                         const render::Viewport& viewport) {
  RasterScene scene;
  const std::size_t corners = std::size_t{one.sides} * (one.rings - 1) + 2;
  scene.vertices.reserve(one.instances * corners);
  scene.indices.reserve(std::size_t{3} * one.instances * one.triangles());
  std::mt19937 random(11);
  const auto uniform = [&] { return static_cast<float>(random() >> 8) * (1.0F / 16777216.0F); };
  const float height_m = kPxM * one.height_px, width_m = 0.375F * height_m;
  for (std::uint32_t i = 0; i < one.instances; ++i) {
    const float depth_m = kNearestM + (kFarthestM - kNearestM) * (static_cast<float>(i) + 0.5F) /
                                          static_cast<float>(one.instances);
    const float x = (uniform() - 0.5F) * kPxM * static_cast<float>(viewport.width_px);
    const float z = (uniform() - 0.5F) * kPxM * static_cast<float>(viewport.height_px);
    const glm::vec3 centre = glm::vec3(glm::dvec3(x, depth_m, z) - camera.eye_world);
    const auto seed = static_cast<std::uint32_t>(random());
    scene.begin_instance(centre - glm::vec3(0.0F, 0.0F, 0.5F * height_m), 0, seed, 0.0F,
                         height_m / 1.75F);
    add_ellipsoid(scene, centre, {0.5F * width_m, 0.5F * width_m, 0.5F * height_m},
                  6.2831853F * uniform(), one);
  }
  return scene;
}

}  // namespace throng::bench
