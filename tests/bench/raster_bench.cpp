// Rasterizers and encoders: time for each triangle and pixel, of all cores together (processor
// time), so that a machine shared with others still gives numbers.
//
// BM_Draw arguments: rasterizer (1 gl, 2 visibility), agents, bones' sides (more sides, more and
// smaller triangles). The crowd of mannequins fills most of 1280x720. Rates are for the whole draw,
// from the batched arrays to the picture in memory; BM_DrawNothing is what a frame costs in any
// case.

#include <benchmark/benchmark.h>

#include <cmath>

#include "support/raster_scene.hpp"
#include "throng/render/encode.hpp"
#include "throng/render/raster.hpp"

namespace throng::render {
namespace {

constexpr Viewport kViewport{1280, 720};

Camera camera_for(std::uint32_t agents) {
  // farther as the crowd grows, so that it always fills the picture
  const double side_m = 1.5 * std::sqrt(static_cast<double>(agents));
  Camera camera;
  camera.eye_world = {0.0, -0.95 * side_m, 0.55 * side_m};
  camera.target_world = {0.0, -0.05 * side_m, 0.5};
  return camera;
}

void per(benchmark::State& state, const char* name, double count) {
  state.counters[name] = benchmark::Counter(
      count, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void draw(benchmark::State& state, const test::RasterScene& scene, const Camera& camera) {
  auto rasterizer = make_rasterizer(static_cast<RasterKind>(state.range(0)));
  if (!rasterizer.ok())
    return state.SkipWithError(std::string(rasterizer.status().message()).c_str());
  if (auto status = (*rasterizer)->upload(test::mannequin_cast()); !status.ok()) {
    return state.SkipWithError(std::string(status.message()).c_str());
  }
  Picture picture;
  for (auto _ : state) {
    const auto status =
        (*rasterizer)->draw(scene.geometry(), camera, kViewport, {0, 0, 0}, Look{}, picture);
    if (!status.ok()) return state.SkipWithError(std::string(status.message()).c_str());
  }
  state.SetLabel((*rasterizer)->info().name);
  per(state, "time/pixel", double{kViewport.width_px} * kViewport.height_px);
  if (!scene.indices.empty())
    per(state, "time/triangle", static_cast<double>(scene.indices.size() / 3));
}

void BM_DrawNothing(benchmark::State& state) { draw(state, {}, camera_for(100)); }
BENCHMARK(BM_DrawNothing)->Arg(1)->Arg(2)->MeasureProcessCPUTime()->Unit(benchmark::kMillisecond);

void BM_Draw(benchmark::State& state) {
  const auto agents = static_cast<std::uint32_t>(state.range(1));
  const Camera camera = camera_for(agents);
  draw(state,
       test::mannequin_crowd(camera, agents, 1.5F, static_cast<std::uint32_t>(state.range(2))),
       camera);
}
BENCHMARK(BM_Draw)
    ->ArgsProduct({{1, 2}, {30, 300}, {8, 20}})
    ->Args({1, 3000, 6})
    ->Args({2, 3000, 6})
    ->MeasureProcessCPUTime()
    ->Unit(benchmark::kMillisecond);

/// A picture of a crowd, as encoders get it.
const Picture& crowd_picture() {
  static const Picture picture = [] {
    Picture drawn;
    const Camera camera = camera_for(300);
    const auto scene = test::mannequin_crowd(camera, 300, 1.5F);
    for (const RasterKind kind : {RasterKind::kVisibility, RasterKind::kGl}) {
      auto rasterizer = make_rasterizer(kind);
      if (!rasterizer.ok() || !(*rasterizer)->upload(test::mannequin_cast()).ok()) continue;
      if ((*rasterizer)->draw(scene.geometry(), camera, kViewport, {0, 0, 0}, Look{}, drawn).ok())
        break;
    }
    return drawn;
  }();
  return picture;
}

void BM_EncodeJpeg(benchmark::State& state) {
  const Picture& picture = crowd_picture();
  JpegEncoder encoder;
  std::size_t size_bytes = 0;
  for (auto _ : state) {
    const auto jpeg = encoder.encode(picture.rgbx, picture.width_px, picture.height_px,
                                     static_cast<int>(state.range(0)));
    if (!jpeg.ok()) return state.SkipWithError("encode");
    size_bytes = jpeg->size();
  }
  state.counters["bytes"] = static_cast<double>(size_bytes);
  per(state, "time/pixel", double{kViewport.width_px} * kViewport.height_px);
}
BENCHMARK(BM_EncodeJpeg)->Arg(60)->Arg(85)->Arg(95)->Unit(benchmark::kMillisecond);

void BM_DecodeJpeg(benchmark::State& state) {
  const Picture& picture = crowd_picture();
  JpegEncoder encoder;
  const auto jpeg = encoder.encode(picture.rgbx, picture.width_px, picture.height_px, 85);
  for (auto _ : state) {
    if (!jpeg.ok() || !decode_jpeg(*jpeg).ok()) return state.SkipWithError("decode");
  }
  per(state, "time/pixel", double{kViewport.width_px} * kViewport.height_px);
}
BENCHMARK(BM_DecodeJpeg)->Unit(benchmark::kMillisecond);

void BM_EncodePng(benchmark::State& state) {
  const Picture& picture = crowd_picture();
  std::size_t size_bytes = 0;
  for (auto _ : state) {
    const auto png = encode_png(picture.rgbx, picture.width_px, picture.height_px);
    if (!png.ok()) return state.SkipWithError("encode");
    size_bytes = png->size();
  }
  state.counters["bytes"] = static_cast<double>(size_bytes);
  per(state, "time/pixel", double{kViewport.width_px} * kViewport.height_px);
}
BENCHMARK(BM_EncodePng)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace throng::render
