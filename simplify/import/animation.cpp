#include "simplify/import/animation.hpp"

#include <absl/container/flat_hash_map.h>
#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <set>
#include <utility>

#include "simplify/import/accessor.hpp"
#include "simplify/import/limits.hpp"

namespace throng::simplify::gltf {
namespace {

enum class Interpolation { kStep, kLinear, kCubic };

/// The keys of one property. Cubic rows are in-tangent, value, out-tangent.
struct Track {
  std::uint32_t components = 3;
  Interpolation interpolation = Interpolation::kLinear;
  std::vector<float> times;
  std::vector<float> values;
};

struct NodeTracks {
  std::uint32_t node = 0;
  Track translation, rotation, scale;  // no times: not animated
};

struct Keys {
  double start_s = 0.0;
  double end_s = 0.0;
  std::vector<NodeTracks> nodes;
};

glm::dvec4 row(const Track& track, std::size_t index) {
  glm::dvec4 value(0.0);
  for (std::uint32_t c = 0; c < track.components; ++c) {
    value[static_cast<int>(c)] = track.values[index * track.components + c];
  }
  return value;
}

glm::dvec4 slerp(const glm::dvec4& a, glm::dvec4 b, double t) {
  double cosine = glm::dot(a, b);
  if (cosine < 0.0) {
    b = -b;
    cosine = -cosine;
  }
  if (cosine > 0.9999) return a + (b - a) * t;
  const double angle = std::acos(std::min(cosine, 1.0));
  return (a * std::sin((1.0 - t) * angle) + b * std::sin(t * angle)) / std::sin(angle);
}

/// The value at a time, held before the first and after the last key (glTF 2.0 appendix C).
glm::dvec4 evaluate(const Track& track, double time_s) {
  const bool cubic = track.interpolation == Interpolation::kCubic;
  const auto value_at = [&](std::size_t key) { return row(track, cubic ? key * 3 + 1 : key); };
  const auto above =
      std::upper_bound(track.times.begin(), track.times.end(), static_cast<float>(time_s));
  if (above == track.times.begin()) return value_at(0);
  if (above == track.times.end()) return value_at(track.times.size() - 1);
  const std::size_t next = static_cast<std::size_t>(above - track.times.begin());
  const std::size_t last = next - 1;
  if (track.interpolation == Interpolation::kStep) return value_at(last);

  const double span_s = double{track.times[next]} - double{track.times[last]};
  const double t = std::clamp((time_s - double{track.times[last]}) / span_s, 0.0, 1.0);
  if (!cubic) {
    return track.components == 4 ? slerp(value_at(last), value_at(next), t)
                                 : value_at(last) + (value_at(next) - value_at(last)) * t;
  }
  // Hermite spline; tangents are per second
  const double t2 = t * t;
  const double t3 = t2 * t;
  return value_at(last) * (2.0 * t3 - 3.0 * t2 + 1.0) +
         row(track, last * 3 + 2) * (span_s * (t3 - 2.0 * t2 + t)) +
         value_at(next) * (-2.0 * t3 + 3.0 * t2) + row(track, next * 3) * (span_s * (t3 - t2));
}

void apply(const Keys& keys, double time_s, std::vector<Local>& locals) {
  for (const NodeTracks& node : keys.nodes) {
    Local local = decomposed(locals[node.node]);
    if (!node.translation.times.empty()) local.translation = evaluate(node.translation, time_s);
    if (!node.scale.times.empty()) local.scale = evaluate(node.scale, time_s);
    if (!node.rotation.times.empty()) {
      const glm::dvec4 rotation = evaluate(node.rotation, time_s);
      const double length = glm::length(rotation);
      if (length > 1e-9) local.rotation = rotation / length;
    }
    locals[node.node] = local;
  }
}

absl::StatusOr<Track> read_track(const Document& document, const AnimationSampler& sampler,
                                 std::uint32_t components) {
  const absl::StatusOr<Table<float>> times = read_floats(document, sampler.input);
  if (!times.ok()) return times.status();
  const absl::StatusOr<Table<float>> values = read_floats(document, sampler.output);
  if (!values.ok()) return values.status();
  Track track;
  track.components = components;
  track.interpolation = sampler.interpolation == "STEP"          ? Interpolation::kStep
                        : sampler.interpolation == "CUBICSPLINE" ? Interpolation::kCubic
                                                                 : Interpolation::kLinear;
  const std::uint64_t rows = times->count * (track.interpolation == Interpolation::kCubic ? 3 : 1);
  if (times->components != 1 || times->count == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("accessor ", sampler.input, " is not a list of at least one time"));
  }
  if (values->components != components || values->count < rows) {
    return absl::InvalidArgumentError(
        absl::StrCat("accessor ", sampler.output, " has ", values->count, " rows of ",
                     values->components, " numbers, must have ", rows, " of ", components));
  }
  for (std::size_t i = 0; i < times->values.size(); ++i) {
    const float time_s = times->values[i];
    if (!std::isfinite(time_s) || std::abs(time_s) > kMaxClipSeconds) {
      return absl::InvalidArgumentError(absl::StrCat("accessor ", sampler.input, " has time ",
                                                     time_s, " s, the limit is ", kMaxClipSeconds));
    }
    if (i > 0 && time_s < times->values[i - 1]) {
      return absl::InvalidArgumentError(absl::StrCat("accessor ", sampler.input, " time ", i,
                                                     " is ", time_s,
                                                     " s, earlier than the one before"));
    }
  }
  for (const float value : values->values) {
    if (!(std::abs(value) <= 1e9F)) {
      return absl::InvalidArgumentError(absl::StrCat("accessor ", sampler.output, " has the value ",
                                                     value, ", the limit is 1e9"));
    }
  }
  track.times = times->values;
  track.values = values->values;
  return track;
}

/// @param value_count  grows by what was read, over all animations.
absl::StatusOr<Keys> read_keys(const Document& document, const Animation& animation,
                               std::uint64_t& value_count) {
  Keys keys;
  absl::flat_hash_map<std::uint32_t, std::size_t> slot_of;
  bool is_first = true;
  for (std::size_t i = 0; i < animation.channels.size(); ++i) {
    const AnimationChannel& channel = animation.channels[i];
    const bool rotation = channel.path == "rotation";
    if (channel.node == kNone ||
        (!rotation && channel.path != "translation" && channel.path != "scale")) {
      continue;  // morph weights and targets of extensions
    }
    absl::StatusOr<Track> track =
        read_track(document, animation.samplers[channel.sampler], rotation ? 4 : 3);
    if (!track.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat("channel ", i, " sampler ", channel.sampler, " ", track.status().message()));
    }
    keys.start_s =
        is_first ? track->times.front() : std::min(keys.start_s, double{track->times.front()});
    keys.end_s = is_first ? track->times.back() : std::max(keys.end_s, double{track->times.back()});
    is_first = false;
    const std::uint32_t node = static_cast<std::uint32_t>(channel.node);
    const auto [found, added] = slot_of.try_emplace(node, keys.nodes.size());
    if (added) keys.nodes.emplace_back().node = node;
    NodeTracks& tracks = keys.nodes[found->second];
    (rotation                  ? tracks.rotation
     : channel.path == "scale" ? tracks.scale
                               : tracks.translation) = *std::move(track);
  }
  return keys;
}

/// Exporters that write one nameless animation for each joint mean one clip.
bool belong_together(const Document& document) {
  if (document.animations.size() < 2) return false;
  std::set<std::pair<std::int32_t, std::string>> targets;
  for (const Animation& animation : document.animations) {
    if (!animation.name.empty()) return false;
    for (const AnimationChannel& channel : animation.channels) {
      if (!targets.emplace(channel.node, channel.path).second) return false;
    }
  }
  return true;
}

Animation joined(const Document& document) {
  Animation all;
  for (const Animation& animation : document.animations) {
    const std::uint32_t base = static_cast<std::uint32_t>(all.samplers.size());
    all.samplers.insert(all.samplers.end(), animation.samplers.begin(), animation.samplers.end());
    for (AnimationChannel channel : animation.channels) {
      channel.sampler += base;
      all.channels.push_back(std::move(channel));
    }
  }
  return all;
}

/// Names that differ only in an exporter's prefix or in case are the same joint.
std::string plain_name(const std::string& name) {
  const std::size_t colon = name.rfind(':');
  return absl::AsciiStrToLower(colon == std::string::npos ? name : name.substr(colon + 1));
}

bool is_same_rest(const Local& a, const Local& b) {
  const glm::dmat4 first = matrix_of(a);
  const glm::dmat4 second = matrix_of(b);
  const double size = 1e-6 + glm::length(first[3] - glm::dvec4(0, 0, 0, 1));
  for (int c = 0; c < 3; ++c) {
    if (glm::length(first[c] - second[c]) > 1e-3 * (1.0 + glm::length(first[c]))) return false;
  }
  return glm::length(first[3] - second[3]) <= 1e-2 * size;
}

/// Rotations of all nodes in the scene's frame, scales left out.
std::vector<glm::dvec4> world_rotations(const Scene& scene, const std::vector<Local>& locals) {
  std::vector<glm::dvec4> world(locals.size());
  for (const std::uint32_t node : scene.order) {
    const glm::dvec4 own = decomposed(locals[node]).rotation;
    const std::int32_t parent = scene.parent[node];
    world[node] =
        parent == kNone ? own : multiply_rotations(world[static_cast<std::size_t>(parent)], own);
  }
  return world;
}

/// Another file's clips, and how its nodes map to ours.
struct Lender {
  Document document;
  Scene scene;
  std::vector<Motion> motions;
  std::vector<glm::dvec4> rest_rotations;
};

}  // namespace

absl::StatusOr<std::vector<Motion>> read_motions(const Document& document,
                                                 std::vector<std::string>& notes) {
  std::vector<Animation> animations = document.animations;
  if (belong_together(document)) {
    notes.push_back(
        absl::StrCat(animations.size(), " nameless animations of different joints are one clip"));
    animations = {joined(document)};
  }
  if (animations.size() > kMaxClips) {
    return absl::InvalidArgumentError(
        absl::StrCat("has ", animations.size(), " animations, the limit is ", kMaxClips));
  }
  std::vector<Motion> motions;
  std::uint64_t value_count = 0;
  for (std::size_t i = 0; i < animations.size(); ++i) {
    absl::StatusOr<Keys> keys = read_keys(document, animations[i], value_count);
    if (!keys.ok()) {
      return absl::InvalidArgumentError(
          absl::StrCat("animation ", i, " ", keys.status().message()));
    }
    const std::string name =
        animations[i].name.empty() ? absl::StrCat("clip_", i) : animations[i].name;
    if (keys->nodes.empty()) {
      notes.push_back(absl::StrCat("animation ", i, " (", name, ") moves no node and is left out"));
      continue;
    }
    Motion& motion = motions.emplace_back();
    motion.name = name;
    motion.duration_s = keys->end_s - keys->start_s;
    for (const NodeTracks& node : keys->nodes) motion.moved.push_back(node.node);
    motion.pose = [shared = std::make_shared<const Keys>(*std::move(keys))](
                      double time_s, std::vector<Local>& locals) {
      apply(*shared, shared->start_s + time_s, locals);
    };
  }
  return motions;
}

absl::StatusOr<std::vector<Motion>> borrow_motions(const Document& document, const Scene& scene,
                                                   const std::string& clip_file,
                                                   std::vector<std::string>& notes) {
  const auto fail = [&](absl::string_view what) {
    return absl::InvalidArgumentError(absl::StrCat(clip_file, ": ", what));
  };
  auto lender = std::make_shared<Lender>();
  const absl::StatusOr<Bytes> bytes = read_file(clip_file, kMaxFileBytes);
  if (!bytes.ok()) return bytes.status();
  absl::StatusOr<Document> other = read_document(*bytes, clip_file);
  if (!other.ok()) return fail(other.status().message());
  lender->document = *std::move(other);
  lender->scene = make_scene(lender->document);
  lender->rest_rotations = world_rotations(lender->scene, lender->scene.rest);
  absl::StatusOr<std::vector<Motion>> motions = read_motions(lender->document, notes);
  if (!motions.ok()) return fail(motions.status().message());
  lender->motions = *std::move(motions);
  if (lender->motions.empty()) return fail("has no clip");

  // our node for each of theirs
  absl::flat_hash_map<std::string, std::uint32_t> ours;
  for (const std::uint32_t node : scene.order) {
    if (!document.nodes[node].name.empty())
      ours.try_emplace(plain_name(document.nodes[node].name), node);
  }
  std::vector<std::int32_t> node_of(lender->document.nodes.size(), kNone);
  std::size_t matched = 0;
  std::size_t wanted = 0;
  bool same_rest = true;
  std::vector<char> is_moved(node_of.size(), 0);
  for (const Motion& motion : lender->motions) {
    for (const std::uint32_t node : motion.moved) is_moved[node] = 1;
  }
  for (std::size_t i = 0; i < node_of.size(); ++i) {
    if (is_moved[i] == 0) continue;
    ++wanted;
    const auto found = ours.find(plain_name(lender->document.nodes[i].name));
    if (found == ours.end()) continue;
    ++matched;
    node_of[i] = static_cast<std::int32_t>(found->second);
    same_rest = same_rest && is_same_rest(lender->scene.rest[i], scene.rest[found->second]);
  }
  // fewer than a third of the joints would make a statue with a moving head
  if (matched * 3 < wanted || matched == 0) {
    return fail(absl::StrCat("only ", matched, " of its ", wanted, " moving joints are in ",
                             document.path, ", at least a third must be"));
  }
  if (matched < wanted) {
    notes.push_back(absl::StrCat(std::filesystem::path(clip_file).filename().string(), ": ",
                                 wanted - matched, " of ", wanted,
                                 " moving joints are not in this skeleton and are left out"));
  }
  if (!same_rest) {
    notes.push_back(absl::StrCat(std::filesystem::path(clip_file).filename().string(),
                                 ": its rest pose differs, clips are carried over relative to it"));
  }

  std::vector<Motion> result;
  const std::vector<glm::dvec4> our_rest = world_rotations(scene, scene.rest);
  for (std::size_t m = 0; m < lender->motions.size(); ++m) {
    Motion& motion = result.emplace_back();
    motion.name = lender->motions[m].name;
    motion.duration_s = lender->motions[m].duration_s;
    for (const std::uint32_t node : lender->motions[m].moved) {
      if (node_of[node] != kNone) motion.moved.push_back(static_cast<std::uint32_t>(node_of[node]));
    }
    if (motion.moved.empty()) {
      result.pop_back();
      continue;
    }
    if (same_rest) {
      motion.pose = [lender, m, node_of](double time_s, std::vector<Local>& locals) {
        std::vector<Local> theirs = lender->scene.rest;
        lender->motions[m].pose(time_s, theirs);
        for (const std::uint32_t node : lender->motions[m].moved) {
          if (node_of[node] != kNone)
            locals[static_cast<std::size_t>(node_of[node])] = theirs[node];
        }
      };
      continue;
    }
    motion.pose = [lender, m, node_of, our_rest, scene](double time_s, std::vector<Local>& locals) {
      std::vector<Local> theirs = lender->scene.rest;
      lender->motions[m].pose(time_s, theirs);
      const std::vector<glm::dvec4> their_world = world_rotations(lender->scene, theirs);
      std::vector<std::int32_t> their_node(locals.size(), kNone);
      for (std::size_t i = 0; i < node_of.size(); ++i) {
        if (node_of[i] != kNone)
          their_node[static_cast<std::size_t>(node_of[i])] = static_cast<std::int32_t>(i);
      }
      // what turned theirs away from its rest, in the scene's frame, turns ours away from its own
      std::vector<glm::dvec4> world(locals.size());
      for (const std::uint32_t node : scene.order) {
        const std::int32_t parent = scene.parent[node];
        const glm::dvec4 base =
            parent == kNone ? glm::dvec4(0, 0, 0, 1) : world[static_cast<std::size_t>(parent)];
        const std::int32_t from = their_node[node];
        if (from == kNone) {
          world[node] = multiply_rotations(base, decomposed(locals[node]).rotation);
          continue;
        }
        const std::size_t theirs_at = static_cast<std::size_t>(from);
        const glm::dvec4 turn = multiply_rotations(
            their_world[theirs_at], inverse_rotation(lender->rest_rotations[theirs_at]));
        world[node] = multiply_rotations(turn, our_rest[node]);
        Local local = decomposed(locals[node]);
        local.rotation = multiply_rotations(inverse_rotation(base), world[node]);
        const Local rest = decomposed(lender->scene.rest[theirs_at]);
        const double ratio = glm::length(rest.translation) > 1e-9
                                 ? glm::length(local.translation) / glm::length(rest.translation)
                                 : 1.0;
        local.translation += (decomposed(theirs[theirs_at]).translation - rest.translation) * ratio;
        locals[node] = local;
      }
    };
  }
  return result;
}

}  // namespace throng::simplify::gltf
