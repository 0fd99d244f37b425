#include "bench/experiments/measure.hpp"

namespace throng::bench {
namespace {

using render::StageTimes;

constexpr double StageTimes::*kStages[] = {&StageTimes::advance_ms,  &StageTimes::cull_ms,
                                           &StageTimes::select_ms,   &StageTimes::allocate_ms,
                                           &StageTimes::generate_ms, &StageTimes::raster_ms,
                                           &StageTimes::resolve_ms,  &StageTimes::read_back_ms};

nlohmann::ordered_json json_of(const Range& range) {
  if (range.count == 0) return nullptr;
  return {{"min", range.min}, {"max", range.max}, {"mean", range.mean()}};
}

}  // namespace

void Measured::add(const render::FrameStats& stats, const Ticks& frame, const Ticks& encode) {
  ++frames;
  visible.add(stats.counters.visible);
  vertices.add(static_cast<double>(stats.counters.vertices));
  triangles.add(static_cast<double>(stats.counters.triangles));
  wall_ms.add(1e3 * frame.wall_s);
  cpu_ms.add(1e3 * frame.cpu_s);
  encode_wall_ms.add(1e3 * encode.wall_s);
  encode_cpu_ms.add(1e3 * encode.cpu_s);
  for (double StageTimes::*stage : kStages) {
    stage_sum.*stage += stats.times.*stage;
    cpu_stage_sum.*stage += stats.cpu_times.*stage;
  }
}

void Measured::add(const Measured& other) {
  frames += other.frames;
  for (Range Measured::*range :
       {&Measured::visible, &Measured::vertices, &Measured::triangles, &Measured::wall_ms,
        &Measured::cpu_ms, &Measured::encode_wall_ms, &Measured::encode_cpu_ms}) {
    (this->*range).add(other.*range);
  }
  for (double StageTimes::*stage : kStages) {
    stage_sum.*stage += other.stage_sum.*stage;
    cpu_stage_sum.*stage += other.cpu_stage_sum.*stage;
  }
}

double Measured::stage_ms(double StageTimes::*stage) const {
  return frames == 0 ? 0.0 : stage_sum.*stage / static_cast<double>(frames);
}
double Measured::cpu_stage_ms(double StageTimes::*stage) const {
  return frames == 0 ? 0.0 : cpu_stage_sum.*stage / static_cast<double>(frames);
}

nlohmann::ordered_json Measured::json() const {
  const auto stages = [this](const StageTimes& sum) {
    const double each = frames == 0 ? 0.0 : 1.0 / static_cast<double>(frames);
    return nlohmann::ordered_json{
        {"advance", sum.advance_ms * each},
        {"cull", sum.cull_ms * each},
        {"select", sum.select_ms * each},
        {"allocate", sum.allocate_ms * each},
        {"generate", sum.generate_ms * each},
        {"raster", (sum.raster_ms + sum.resolve_ms + sum.read_back_ms) * each}};
  };
  return {{"frames", frames},
          {"fps", fps()},
          {"visible", json_of(visible)},
          {"vertices", json_of(vertices)},
          {"triangles", json_of(triangles)},
          {"frame_wall_ms", json_of(wall_ms)},
          {"frame_cpu_ms", json_of(cpu_ms)},
          {"stage_wall_ms", stages(stage_sum)},
          {"stage_cpu_ms", stages(cpu_stage_sum)},
          {"encode_wall_ms", encode_wall_ms.mean()},
          {"encode_cpu_ms", encode_cpu_ms.mean()}};
}

absl::Status measure_frame(render::FramePipeline& pipeline, const render::Crowd& crowd,
                           std::int64_t time_us, const render::ViewSettings& view,
                           render::JpegEncoder& jpeg, render::Picture& picture,
                           Measured& measured) {
  render::FrameStats stats;
  const Ticks start = Ticks::now();
  if (absl::Status status = pipeline.render(crowd, time_us, view, picture, stats); !status.ok()) {
    return status;
  }
  const Ticks drawn = Ticks::now();
  const auto bytes = jpeg.encode(picture.rgbx, picture.width_px, picture.height_px, 75);
  if (!bytes.ok()) return bytes.status();
  measured.add(stats, drawn.since(start), Ticks::now().since(drawn));
  return absl::OkStatus();
}

}  // namespace throng::bench
