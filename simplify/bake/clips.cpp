#include "simplify/bake/clips.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "simplify/collapse/collapse.hpp"

namespace throng::simplify {
namespace {

using render::Affine;
using render::ClipKind;

Affine affine(const glm::mat4& matrix) {
  const glm::mat4 rows = glm::transpose(matrix);
  return {{rows[0], rows[1], rows[2]}};
}

bool is_finite(const Affine& matrix) {
  for (const glm::vec4& row : matrix.row) {
    for (int i = 0; i < 4; ++i) {
      if (!(std::fabs(row[i]) <= 1.0e6F)) return false;
    }
  }
  return true;
}

void move(std::span<Affine> frame, const glm::vec3& by) {
  for (Affine& matrix : frame) {
    for (int i = 0; i < 3; ++i) matrix.row[i].w += by[i];
  }
}

/// The value that the given share of values is below: 0.5 is the median.
float share_of(std::vector<float> values, float share) {
  if (values.empty()) return 0.0F;
  const auto index = std::min(values.size() - 1,
                              static_cast<std::size_t>(share * static_cast<float>(values.size())));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(index);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Distance of a cycle from how far the feet swing: a foot stands for about 60 % of a walking cycle
/// and 40 % of a running one (Novacheck 1998), and then goes back by what the body goes forward.
float stride_from_swing(float swing_m, ClipKind kind) {
  return swing_m / (kind == ClipKind::kRun ? 0.4F : 0.6F);
}

/// Shifts a clip so that it stands on the ground. A walk always has a foot down, so each of its
/// frames is put there; a standing clip as a whole, by its median; a run by its lowest frames.
/// Returns the farthest shift in metres.
float put_on_ground(std::vector<Affine>& palette, std::size_t joints,
                    const std::vector<float>& lowest_m, ClipKind kind, float height_m) {
  const std::size_t frames = lowest_m.size();
  const float whole_m = share_of(lowest_m, kind == ClipKind::kRun ? 0.1F : 0.5F);
  if (std::fabs(whole_m) > 0.15F * height_m) return 0.0F;  // flies or swims
  float farthest_m = 0.0F;
  for (std::size_t f = 0; f < frames; ++f) {
    float shift_m = whole_m;
    if (kind == ClipKind::kWalk) {
      // three frames together, so that one that is off doesn't jerk
      const float mean_m =
          (lowest_m[(f + frames - 1) % frames] + lowest_m[f] + lowest_m[(f + 1) % frames]) / 3.0F;
      shift_m = std::clamp(mean_m, whole_m - 0.06F * height_m, whole_m + 0.06F * height_m);
    }
    move(std::span(palette).subspan(f * joints, joints), {0, 0, -shift_m});
    farthest_m = std::max(farthest_m, std::fabs(shift_m));
  }
  return farthest_m;
}

/// One clip while it is prepared; frames [F][J].
class Preparer {
 public:
  Preparer(const SourceCharacter& source, float height_m)
      : joints_(source.joints.size()), height_m_(height_m) {
    // evenly spaced points of the whole body, and of what may be legs
    const std::size_t stride = std::max<std::size_t>(1, source.points.size() / 500);
    for (std::size_t i = 0; i < source.points.size(); i += stride)
      body_.push_back(source.points[i]);
    std::vector<SourcePoint> low;
    for (const SourcePoint& point : source.points) {
      if (point.position.z < 0.2F * height_m) low.push_back(point);
    }
    const std::size_t low_stride = std::max<std::size_t>(1, low.size() / 1500);
    for (std::size_t i = 0; i < low.size(); i += low_stride) legs_.push_back(low[i]);
    if (legs_.empty()) legs_ = body_;
  }

  std::span<Affine> frame(std::vector<Affine>& palette, std::size_t f) const {
    return std::span(palette).subspan(f * joints_, joints_);
  }

  glm::vec3 body_centre(std::span<const Affine> palette) const {
    std::vector<glm::vec3> position(body_.size());
    skin(body_, palette, position);
    glm::vec3 sum(0.0F);
    for (const glm::vec3& each : position) sum += each;
    return sum / static_cast<float>(position.size());
  }

  /// Takes out the way of one cycle and a repeated last frame. Returns the way's length in metres.
  float remove_root_motion(std::vector<Affine>& palette, bool loop) const {
    std::size_t frames = palette.size() / joints_;
    if (frames < 2) return 0.0F;
    std::vector<glm::vec2> centre(frames);
    for (std::size_t f = 0; f < frames; ++f) centre[f] = glm::vec2(body_centre(frame(palette, f)));
    const glm::vec3 way(centre.back() - centre.front(), 0.0F);
    // A clip on the spot comes back by itself: from its last frame to its first is a step like
    // others.
    float longest_step_m = 0.0F;
    for (std::size_t f = 0; f + 1 < frames; ++f) {
      longest_step_m = std::max(longest_step_m, glm::distance(centre[f], centre[f + 1]));
    }
    const bool is_moving = glm::length(way) > std::max(0.06F * height_m_, 3.0F * longest_step_m);

    // The last frame is the first one again if they differ by much less than neighbours do, apart
    // from the way in both.
    const auto difference = [&](std::size_t from, std::size_t to, const glm::vec3& moved) {
      float largest = 0.0F;
      const auto a = frame(palette, from), b = frame(palette, to);
      for (std::size_t j = 0; j < joints_; ++j) {
        for (int i = 0; i < 3; ++i) {
          const glm::vec4 delta =
              b[j].row[i] - a[j].row[i] - glm::vec4(0, 0, 0, is_moving ? moved[i] : 0.0F);
          largest = std::max(
              largest, std::max(std::fabs(delta.w) / height_m_, glm::length(glm::vec3(delta))));
        }
      }
      return largest;
    };
    bool is_repeated = false;
    if (loop && frames > 2) {
      const float between = difference(0, frames - 1, way);
      const float step = difference(frames - 2, frames - 1, way / static_cast<float>(frames - 1));
      is_repeated = between < 0.02F && between < 0.3F * step;
    }
    const auto intervals = static_cast<float>(frames - 1);
    if (is_repeated) {
      --frames;
      palette.resize(frames * joints_);
    }
    if (!is_moving) return 0.0F;
    for (std::size_t f = 0; f < frames; ++f)
      move(frame(palette, f), -way * (static_cast<float>(f) / intervals));
    // without the repeated frame the step from the last frame to the first is one more interval
    return glm::length(way) * (is_repeated ? 1.0F : (intervals + 1.0F) / intervals);
  }

  /// What the lowest points do.
  struct Stance {
    float speed_mps = 0.0F;       // backward, while they touch the ground
    float swing_m = 0.0F;         // how far feet go forward and back
    std::vector<float> lowest_m;  // [F]
  };
  Stance measure_stance(std::vector<Affine>& palette, float rate_hz, bool loop) const {
    const std::size_t frames = palette.size() / joints_;
    std::vector<std::vector<glm::vec3>> position(frames, std::vector<glm::vec3>(legs_.size()));
    std::vector<float> lowest_m(frames);
    for (std::size_t f = 0; f < frames; ++f) {
      skin(legs_, frame(palette, f), position[f]);
      lowest_m[f] = position[f][0].z;
      for (const glm::vec3& each : position[f]) lowest_m[f] = std::min(lowest_m[f], each.z);
    }
    Stance stance;
    stance.lowest_m = lowest_m;
    const float ground_m = share_of(lowest_m, 0.4F);
    std::vector<float> speeds;
    const float contact_m = 0.012F * height_m_;
    for (std::size_t f = 0; f + (loop ? 0 : 1) < frames && frames > 1; ++f) {
      // a frame in the air has no stance
      if (lowest_m[f] > ground_m + 2.0F * contact_m) continue;
      const auto& now = position[f];
      const auto& next = position[(f + 1) % frames];
      glm::vec2 sum(0.0F);
      int count = 0;
      for (std::size_t i = 0; i < now.size(); ++i) {
        if (now[i].z > lowest_m[f] + contact_m || next[i].z > lowest_m[f] + 2.0F * contact_m)
          continue;
        sum += glm::vec2(next[i]) - glm::vec2(now[i]);
        ++count;
      }
      if (count > 0) speeds.push_back(-sum.x / static_cast<float>(count) * rate_hz);
    }
    stance.speed_mps = share_of(speeds, 0.5F);

    // soles: the lowest points of the bind pose
    std::vector<float> ranges;
    for (std::size_t i = 0; i < legs_.size(); ++i) {
      if (legs_[i].position.z > 0.05F * height_m_) continue;
      float low_m = position[0][i].x, high_m = low_m;
      for (const auto& each : position) {
        low_m = std::min(low_m, each[i].x);
        high_m = std::max(high_m, each[i].x);
      }
      ranges.push_back(high_m - low_m);
    }
    stance.swing_m = share_of(ranges, 0.5F);
    return stance;
  }

 private:
  std::size_t joints_;
  float height_m_;
  std::vector<SourcePoint> body_, legs_;
};

absl::Status check(const SourceClip& clip, std::size_t joints) {
  if (clip.frame_count < 1 ||
      clip.model_from_joint.size() != std::size_t{clip.frame_count} * joints) {
    return absl::InvalidArgumentError(
        absl::StrCat("clip ", clip.name, " has ", clip.model_from_joint.size(),
                     " matrices, must have ", clip.frame_count, " frames x ", joints, " joints"));
  }
  if (!(clip.rate_hz > 0.0F && clip.rate_hz <= 1000.0F)) {
    return absl::InvalidArgumentError(absl::StrCat("clip ", clip.name, " has rate ", clip.rate_hz,
                                                   " Hz, must be over 0 and at most 1000"));
  }
  if (!(clip.stride_m >= 0.0F && clip.stride_m <= 1000.0F)) {
    return absl::InvalidArgumentError(
        absl::StrCat("clip ", clip.name, " has stride ", clip.stride_m, " m"));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<BakedClips> bake_clips(const SourceCharacter& source,
                                      std::vector<std::string>& notes) {
  BakedClips result;
  const std::size_t joints = source.joints.size();
  float height_m = 0.0F;
  for (const SourcePoint& point : source.points) height_m = std::max(height_m, point.position.z);
  if (!(height_m > 0.0F)) height_m = 1.0F;

  if (source.clips.empty()) {
    notes.push_back("no clip: stands in its bind pose");
    result.clips.push_back({"rest", ClipKind::kIdle, 0, 1, 30.0F, true, 0.0F, 0.0F});
    result.palette.assign(joints, affine(glm::mat4(1.0F)));
    return result;
  }

  const Preparer preparer(source, height_m);
  for (const SourceClip& clip : source.clips) {
    if (auto status = check(clip, joints); !status.ok()) return status;
    std::vector<Affine> palette(clip.model_from_joint.size());
    for (std::size_t i = 0; i < palette.size(); ++i) {
      palette[i] = affine(clip.model_from_joint[i] * source.joints[i % joints].joint_from_model);
      if (!is_finite(palette[i])) {
        return absl::InvalidArgumentError(
            absl::StrCat("clip ", clip.name, ": frame ", i / joints, " joint ", i % joints, " (",
                         source.joints[i % joints].name, ") is not finite"));
      }
    }

    const float way_m = preparer.remove_root_motion(palette, clip.loop);
    const auto frames = static_cast<std::uint32_t>(palette.size() / joints);
    const float duration_s = static_cast<float>(frames) / clip.rate_hz;
    const Preparer::Stance stance = preparer.measure_stance(palette, clip.rate_hz, clip.loop);
    float speed_mps = way_m > 0.0F ? way_m / duration_s : std::max(0.0F, stance.speed_mps);
    if (way_m == 0.0F && stance.swing_m > 0.2F * height_m) {
      speed_mps =
          std::max(speed_mps, stride_from_swing(stance.swing_m, ClipKind::kWalk) / duration_s);
    }

    // kind: said, named, or measured; speeds scale with the root of leg length (Froude)
    ClipKind kind = clip.kind != ClipKind::kOther ? clip.kind : kind_from_name(clip.name);
    const float size = std::sqrt(height_m / 1.75F);
    if (kind == ClipKind::kOther && is_generic_name(clip.name) && frames > 2) {
      kind = speed_mps > 2.3F * size    ? ClipKind::kRun
             : speed_mps > 0.25F * size ? ClipKind::kWalk
                                        : ClipKind::kIdle;
      notes.push_back(absl::StrCat("clip ", clip.name.empty() ? "(no name)" : clip.name,
                                   ": taken for ",
                                   kind == ClipKind::kRun    ? "run"
                                   : kind == ClipKind::kWalk ? "walk"
                                                             : "idle",
                                   " by its speed of ", speed_mps, " m/s"));
    }

    const bool is_gait = kind == ClipKind::kWalk || kind == ClipKind::kRun;
    float stride_m = clip.stride_m;
    if (stride_m == 0.0F && way_m > 0.0F) stride_m = way_m;
    if (stride_m == 0.0F && is_gait) {
      // Hand-made clips slide by themselves: where the stance foot says something that the swing of
      // the feet can't be, the swing is taken.
      stride_m = stance.speed_mps * duration_s;
      const float from_swing_m = stride_from_swing(stance.swing_m, kind);
      if (stride_m < 0.6F * from_swing_m || stride_m > 1.7F * from_swing_m) {
        stride_m = from_swing_m > 0.1F * height_m ? from_swing_m : 0.8F * height_m;
        notes.push_back(absl::StrCat("clip ", clip.name, ": feet slide in it, stride taken as ",
                                     stride_m, " m"));
      }
    }
    if (is_gait || kind == ClipKind::kIdle) {
      const float shift_m = put_on_ground(palette, joints, stance.lowest_m, kind, height_m);
      if (shift_m > 0.04F * height_m) {
        notes.push_back(absl::StrCat("clip ", clip.name, ": moved by up to ", shift_m,
                                     " m to stand on the ground"));
      }
    }

    render::Clip baked;
    baked.name = clip.name;
    baked.kind = kind;
    baked.first_frame = static_cast<std::uint32_t>(result.palette.size() / joints);
    baked.frame_count = frames;
    baked.rate_hz = clip.rate_hz;
    baked.loop = clip.loop;
    baked.stride_m = stride_m;
    baked.speed_mps = stride_m / duration_s;
    result.clips.push_back(std::move(baked));
    result.palette.insert(result.palette.end(), palette.begin(), palette.end());
  }
  return result;
}

}  // namespace throng::simplify
