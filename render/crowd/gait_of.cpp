#include "render/crowd/gait_of.hpp"

namespace throng::render {

element::Gait gait_of(const Character& character) {
  element::Gait gait;
  const auto range_of = [](const Clip& clip) {
    return element::ClipRange{clip.first_frame, clip.frame_count, clip.rate_hz};
  };
  for (const Clip& clip : character.clips) {
    if (clip.frame_count == 0) continue;
    if (clip.kind == ClipKind::kIdle && gait.idle.frame_count == 0) {
      gait.idle = range_of(clip);
    } else if (clip.kind == ClipKind::kWalk && gait.walk.frame_count == 0) {
      gait.walk = range_of(clip);
      if (clip.stride_m > 0.0F) gait.walk_stride_m = clip.stride_m;
      if (clip.speed_mps > 0.0F) gait.walk_speed_mps = clip.speed_mps;
    } else if (clip.kind == ClipKind::kRun && gait.run.frame_count == 0) {
      gait.run = range_of(clip);
      if (clip.stride_m > 0.0F) gait.run_stride_m = clip.stride_m;
      if (clip.speed_mps > 0.0F) gait.run_speed_mps = clip.speed_mps;
    }
  }
  if (gait.idle.frame_count + gait.walk.frame_count + gait.run.frame_count == 0) {
    gait.idle = character.clips.empty() || character.clips[0].frame_count == 0
                    ? element::ClipRange{0, 1, 1.0F}
                    : range_of(character.clips[0]);
  }
  return gait;
}

}  // namespace throng::render
