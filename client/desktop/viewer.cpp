#include "client/desktop/viewer.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "client/desktop/view_text.hpp"
#include "client/view/color_map.hpp"

namespace throng::client {

const char* const kOverlayNames[kOverlays] = {"ids", "trails", "density", "grid", "scale", "time"};

namespace {

constexpr std::uint64_t kNotSentYet = std::numeric_limits<std::uint64_t>::max();
constexpr double kGlideS = 0.32, kStampEveryS = 0.5, kCrowdsEveryS = 2.5, kCardEveryS = 1.0;
constexpr double kLargestPicturePx = 1.3e6, kFollowWithinM = 12.0;
constexpr std::uint32_t kMostAgents = 1500;  // that overlays are drawn for
constexpr double kSpeeds[] = {0.1, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0};

glm::dvec3 point_of(const v1::Vec3& message) { return {message.x(), message.y(), message.z()}; }

OrbitCamera held_from(const ScriptedCamera& camera) {
  v1::Camera message;
  const auto fill = [](const glm::dvec3& from, v1::Vec3& to) {
    to.set_x(from.x);
    to.set_y(from.y);
    to.set_z(from.z);
  };
  fill(camera.eye_world, *message.mutable_eye());
  fill(camera.target_world, *message.mutable_target());
  if (camera.ortho_height_m > 0.0) {
    message.set_ortho_height_m(camera.ortho_height_m);
  } else {
    message.set_fov_y_deg(camera.fov_y_deg);
  }
  return OrbitCamera::read(message);
}

}  // namespace

std::string format_time(std::int64_t time_us) {
  const auto tenths =
      static_cast<std::int64_t>(std::llround(std::abs(1e-5 * static_cast<double>(time_us))));
  const std::int64_t s = tenths / 10, minutes = s / 60 % 60, hours = s / 3600;
  const std::string tail = absl::StrFormat("%02d.%d", s % 60, tenths % 10);
  const char* const sign = time_us < 0 ? "-" : "";
  return hours != 0 ? absl::StrFormat("%s%d:%02d:%s", sign, hours, minutes, tail)
                    : absl::StrFormat("%s%d:%s", sign, minutes, tail);
}

std::string format_number(double value) {
  return std::isfinite(value) ? absl::StrFormat("%.3g", value) : "-";
}

Viewer::Viewer(ViewLink& link, const ViewerSettings& settings)
    : link_(link),
      wanted_crowd_(settings.crowd),
      channel_(settings.channel),
      follow_(settings.follow),
      is_live_(!settings.time_us.has_value()),
      is_paused_(settings.time_us.has_value()),
      range_is_auto_(!settings.channel.empty() && !settings.range),
      color_map_(settings.color_map),
      speed_(settings.speed),
      low_(settings.range ? settings.range->first : 0.0),
      high_(settings.range ? settings.range->second : 2.0),
      rate_hz_(settings.rate_hz),
      time_us_(settings.time_us.value_or(0)),
      vertex_budget_(settings.vertex_budget),
      sharpness_(settings.sharpness),
      overlays_(settings.overlays) {
  camera_ = settings.held;
  if (!settings.camera || settings.camera->is_overview()) return;
  if (const CameraScript::Follow* follow = settings.camera->follow()) {
    follow_ = follow->agent;
    camera_.emplace();
    camera_->distance_m = std::hypot(follow->behind_m, follow->height_m - 1.0);
    camera_->pitch_rad = std::atan2(follow->height_m - 1.0, follow->behind_m);
    camera_->fov_y_deg = follow->fov_y_deg;
  } else if (settings.camera->needs_site()) {
    script_ = settings.camera;
  } else {
    camera_ = held_from(settings.camera->at(0.0, {}));
  }
}

// ---- what is wanted -> the server

void Viewer::add_camera(v1::ViewOptions& options) const {
  if (camera_) {
    camera_->write(*options.mutable_camera());
  } else {
    options.set_overview(true);
  }
}

void Viewer::add_channel(v1::ViewOptions& options) const {
  options.set_channel(channel_);
  options.set_color_map(wire_of(color_map_));
  if (!(low_ < high_)) return;
  options.set_channel_low(low_);
  options.set_channel_high(high_);
}

void Viewer::add_overlays(v1::ViewOptions& options) const {
  const bool needs_agents =
      shows(Overlay::kIds) || shows(Overlay::kTrails) || follow_ != 0 || range_is_auto_;
  options.set_max_agent_columns(needs_agents ? kMostAgents : 0);
  options.set_density(shows(Overlay::kDensity));
}

void Viewer::add_size(v1::ViewOptions& options) const {
  const double most_x = has_limits_ ? limits_.max_width_px() : 4096.0;
  const double most_y = has_limits_ ? limits_.max_height_px() : 4096.0;
  const glm::dvec2 wanted_px = glm::max(sharpness_ * window_px_, glm::dvec2(1.0));
  const double largest_px2 = kLargestPicturePx * std::max(1.0, sharpness_);
  const double shrink = std::min({1.0, std::sqrt(largest_px2 / (wanted_px.x * wanted_px.y)),
                                  most_x / wanted_px.x, most_y / wanted_px.y});
  const auto side = [&](double px, double most) {
    const double whole = std::max(16.0, std::round(px * shrink / 8.0) * 8.0);
    return static_cast<std::uint32_t>(std::min(whole, most));
  };
  options.set_width_px(side(wanted_px.x, most_x));
  options.set_height_px(side(wanted_px.y, most_y));
}

v1::ViewOptions Viewer::whole() const {
  v1::ViewOptions options;
  options.set_crowd_name(crowd_);
  options.set_jpeg_quality(82);
  options.set_max_rate_hz(rate_hz_);
  options.set_vertex_budget(vertex_budget_);
  options.set_shadows(shadows_);
  options.set_follow_agent(follow_);
  options.set_stamp(last_stamp_);
  add_size(options);
  add_camera(options);
  add_channel(options);
  add_overlays(options);
  v1::Playback& playback = *options.mutable_playback();
  if (is_live_) {
    playback.set_live(true);
  } else {
    playback.set_scene_time_us(time_us_);
    playback.set_paused(is_paused_);
    playback.set_speed(speed_);
  }
  return options;
}

v1::Playback& Viewer::change_playback() {
  if (!change_) change_.emplace();
  playback_stamp_ = kNotSentYet;  // until it is sent, no frame knows of it
  return *change_->mutable_playback();
}

void Viewer::ask_all() { change_ = whole(); }

void Viewer::flush() {
  if (!change_ || crowd_.empty()) return;
  const auto now_us = static_cast<std::uint64_t>(std::max(0.0, now_s_) * 1e6);
  last_stamp_ = std::max(last_stamp_ + 1, now_us);
  if (change_->ByteSizeLong() > 0) asked_stamp_ = last_stamp_;
  if (change_->has_playback()) playback_stamp_ = last_stamp_;
  if (change_->has_crowd_name()) crowd_stamp_ = last_stamp_;
  if (change_->has_follow_agent()) follow_stamp_ = last_stamp_;
  change_->set_stamp(last_stamp_);
  next_stamp_s_ = now_s_ + kStampEveryS;
  link_.ask(*change_, whole());
  change_.reset();
}

// ---- frames

void Viewer::take_frame(ReceivedFrame frame) {
  const v1::StreamViewResponse& message = frame.message;
  if (message.stamp() < crowd_stamp_) return;  // of the crowd before
  const bool knows_time = message.stamp() >= playback_stamp_;
  const bool was_there = frame_ && frame_->message.followed_agent() == follow_;
  if (follow_ != 0 && message.followed_agent() == 0 && knows_time &&
      message.stamp() >= follow_stamp_ && message.stats().agents() > 0) {
    toast(
        absl::StrCat("No agent ", follow_, " in '", crowd_, "' at this time: nobody is followed"));
    stop_following();
    if (was_there) return;  // the camera would jump to where it last stood on its own
  }
  frame_ = std::move(frame);  // `message` is what was there before
  shown_camera_ = OrbitCamera::read(frame_->message.camera());
  const std::int64_t shown_us = frame_->message.scene_time_us();
  // what was asked for stands until a frame knows of it
  if (knows_time) time_us_ = shown_us;
  if (frame_->message.has_playback() && knows_time) {
    is_live_ = frame_->message.playback().live();
    is_paused_ = frame_->message.playback().paused();
  }
  if (follow_ != 0 && frame_->message.followed_agent() == follow_) {
    if (!camera_) camera_ = OrbitCamera::read(frame_->message.camera());
    camera_->target_world = point_of(frame_->message.camera().target());
  }
  if (script_ && !camera_) {
    const v1::StreamViewResponse& shown = frame_->message;
    const double aspect = static_cast<double>(shown.width_px()) / std::max(1U, shown.height_px());
    camera_ = held_from(
        script_->at(1e-6 * static_cast<double>(shown_us),
                    {point_of(shown.overview_low()), point_of(shown.overview_high()), aspect}));
    camera_moved();
  }
  script_.reset();
  agents_ = unpack_agents(frame_->message.agents());
  if (shows(Overlay::kTrails)) trails_.add(shown_us, agents_);
  if (range_is_auto_) choose_range();

  ++shown_;
  shown_at_s_.push_back(now_s_);
  if (frame_->message.stamp() <= measured_stamp_) return;
  static constexpr std::size_t kLatencies = 60;
  measured_stamp_ = frame_->message.stamp();
  latencies_ms_.push_back(1e3 * now_s_ - 1e-3 * static_cast<double>(measured_stamp_));
  if (latencies_ms_.size() > kLatencies) latencies_ms_.pop_front();
}

void Viewer::choose_range() {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Agent& agent : agents_) {
    if (!std::isfinite(agent.value)) continue;
    low = std::min(low, double{agent.value});
    high = std::max(high, double{agent.value});
  }
  if (channel_.empty() || !(low <= high)) return;
  if (low >= 0.0 && low < 0.5 * high) low = 0.0;
  const double step = std::pow(10.0, std::floor(std::log10(std::max(1e-9, high - low)))) / 2.0;
  low = std::floor(low / step) * step;
  high = std::ceil(high / step) * step;
  range_is_auto_ = false;
  set_range(low, low < high ? high : low + 1.0);
}

void Viewer::refresh_crowds() {
  link_.list_crowds([this](const v1::ListCrowdsResponse& response) {
    crowds_.assign(response.crowds().begin(), response.crowds().end());
    knows_crowds_ = true;
    if (!crowd_.empty()) return;
    for (const v1::CrowdInfo& crowd : crowds_) {
      if (wanted_crowd_.empty() ? crowds_.size() == 1 : crowd.name() == wanted_crowd_) {
        open_crowd(crowd.name());
        return;
      }
    }
  });
}

bool Viewer::update(double now_s, const glm::dvec2& window_px) {
  now_s_ = now_s;
  window_px_ = window_px;
  bool changed = false;
  const ViewLink::Status status = link_.status();
  if (status.state != link_state_) {
    const bool came_back = status.state == LinkState::kOpen;
    link_state_ = status.state;
    link_message_ = status.message;
    changed = true;
    if (came_back || !knows_crowds_) next_crowds_s_ = now_s;
  }
  link_.deliver();
  if (auto frame = link_.take()) {
    take_frame(*std::move(frame));
    changed = true;
  }
  if (now_s >= next_crowds_s_) {
    next_crowds_s_ = now_s + (knows_crowds_ ? kCrowdsEveryS : 0.3);
    refresh_crowds();
    if (!has_limits_) {
      link_.get_server_info([this](const v1::GetServerInfoResponse& info) {
        limits_ = info.limits();
        has_limits_ = true;
        rasterizer_ = info.rasterizer();
      });
    }
  }
  if (now_s >= next_rate_s_) {
    const double seconds = std::max(1.0, now_s - next_rate_s_ + 1.0);
    mbit_per_s_ = static_cast<double>(status.received_bytes - bytes_before_) * 8e-6 / seconds;
    bytes_before_ = status.received_bytes;
    next_rate_s_ = now_s + 1.0;
    changed = true;
  }
  if (card_ && follow_ != 0 && now_s >= next_card_s_ && frame_) {
    next_card_s_ = now_s + kCardEveryS;
    v1::PickAgentRequest request;
    request.mutable_options()->set_crowd_name(crowd_);
    request.set_scene_time_us(time_us_);
    request.set_id(follow_);
    link_.pick(std::move(request), [this](const v1::PickAgentResponse& agent) {
      if (agent.found() && agent.id() == follow_) card_ = agent;
    });
  }
  if (glide_) {
    const double t = std::min(1.0, (now_s - glide_->began_s) / kGlideS);
    camera_ = between(glide_->from, glide_->to, t);
    const std::uint64_t then_follow = t < 1.0 ? 0 : glide_->then_follow;
    if (t >= 1.0) glide_.reset();
    camera_moved();
    if (then_follow != 0) {
      follow_ = then_follow;
      follow_stamp_ = kNotSentYet;
      if (!change_) change_.emplace();
      change_->set_follow_agent(follow_);
      add_overlays(*change_);
    }
    changed = true;
  }
  if (glm::any(glm::notEqual(window_px, asked_px_)) && !crowd_.empty()) {
    asked_px_ = window_px;
    if (!change_) change_.emplace();
    add_size(*change_);
  }
  // how latency is measured while nothing is touched
  if (now_s >= next_stamp_s_ && !change_) change_.emplace();
  flush();
  while (!shown_at_s_.empty() && now_s - shown_at_s_.front() > 2.0) shown_at_s_.pop_front();
  return changed;
}

// ---- the camera

double Viewer::ground_z_m() const {
  const v1::CrowdInfo* crowd = current_crowd();
  return crowd == nullptr ? 0.0 : crowd->low().z();
}

Viewer::Placement Viewer::placement() const {
  glm::dvec2 image_px = window_px_;
  if (frame_) image_px = {frame_->image->width_px, frame_->image->height_px};
  const double factor = std::max(window_px_.x / image_px.x, window_px_.y / image_px.y);
  return {(window_px_ - image_px * factor) * 0.5, image_px * factor, factor};
}

OrbitCamera* Viewer::held_camera() {
  if (!camera_ && frame_) camera_ = OrbitCamera::read(frame_->message.camera());
  return camera_ ? &*camera_ : nullptr;
}

void Viewer::camera_moved() {
  if (!camera_) return;
  const double below_m = ground_z_m() + 0.15 - camera_->eye_world().z;
  if (below_m > 0.0) camera_->target_world.z += below_m;
  if (!change_) change_.emplace();
  change_->clear_overview();
  change_->clear_camera();
  camera_->write(*change_->mutable_camera());
}

void Viewer::drag(const glm::dvec2& from_px, const glm::dvec2& to_px, bool pans) {
  OrbitCamera* const camera = held_camera();
  if (camera == nullptr) return;
  glide_.reset();
  if (!pans) {
    const glm::dvec2 by_px = to_px - from_px;
    camera->orbit(by_px.x * 0.006, by_px.y * 0.006);
  } else if (follow_ == 0) {
    // the ground under the pointer goes along with it
    const Placement at = placement();
    const glm::dvec3 by = camera->ground_at(from_px - at.corner_px, at.size_px, ground_z_m()) -
                          camera->ground_at(to_px - at.corner_px, at.size_px, ground_z_m());
    const double most_m = camera->distance_m * 0.5, size_m = glm::length(by);
    camera->target_world += size_m > most_m ? by * (most_m / size_m) : by;
  }
  camera_moved();
}

void Viewer::zoom_at(double factor, const glm::dvec2& place_px) {
  OrbitCamera* const camera = held_camera();
  if (camera == nullptr) return;
  glide_.reset();
  const Placement at = placement();
  camera->zoom(factor, follow_ != 0 ? camera->target_world
                                    : camera->ground_at(place_px - at.corner_px, at.size_px,
                                                        ground_z_m() + camera->zoom_height_m()));
  camera_moved();
}

void Viewer::click(const glm::dvec2& place_px) {
  if (!frame_) return;
  const Placement at = placement();
  v1::PickAgentRequest request;
  v1::ViewOptions& options = *request.mutable_options();
  options.set_crowd_name(crowd_);
  *options.mutable_camera() = frame_->message.camera();
  options.set_width_px(frame_->image->width_px);
  options.set_height_px(frame_->image->height_px);
  request.set_scene_time_us(frame_->message.scene_time_us());
  request.set_x_px((place_px.x - at.corner_px.x) / at.factor);
  request.set_y_px((place_px.y - at.corner_px.y) / at.factor);
  link_.pick(std::move(request), [this, crowd = crowd_](const v1::PickAgentResponse& agent) {
    if (crowd != crowd_) return;
    if (!agent.found()) {
      stop_following();
      return;
    }
    OrbitCamera* const camera = held_camera();
    if (camera == nullptr) return;
    OrbitCamera goal = *camera;
    goal.distance_m = std::min(goal.distance_m, kFollowWithinM);
    goal.target_world = point_of(agent.position()) + glm::dvec3(0.0, 0.0, goal.follow_height_m());
    release_agent();
    card_ = agent;
    glide(goal, agent.id());
  });
}

void Viewer::glide(const OrbitCamera& goal, std::uint64_t then_follow) {
  if (OrbitCamera* const camera = held_camera()) {
    glide_ = Glide{*camera, goal, now_s_, then_follow};
  }
}

void Viewer::fly(const Flight& flight, double seconds, double held_s) {
  OrbitCamera* const camera = held_camera();
  if (camera == nullptr || !flight.any()) return;
  glide_.reset();
  const double fast = flight.fast ? 4.0 : 1.0;
  // starts gently, so that a tap is a small step
  const double eased = std::min(1.0, 0.35 + held_s / 0.6);
  if (follow_ == 0) {
    const double way_m = std::max(2.0, camera->distance_m * 0.7) * fast * seconds * eased;
    const glm::dvec3 ahead(-std::cos(camera->yaw_rad), -std::sin(camera->yaw_rad), 0.0);
    camera->target_world += (ahead * flight.ahead + camera->right() * flight.right) * way_m;
    camera->target_world.z += flight.up * way_m * 0.6;
  }
  const double turn_rad = 1.4 * seconds * fast * eased;
  camera->orbit(flight.turn * turn_rad, flight.tilt * turn_rad * 0.7);
  if (flight.zoom != 0.0) {
    camera->zoom(std::exp(-flight.zoom * 1.6 * seconds * fast), camera->target_world);
  }
  camera_moved();
}

void Viewer::fit() {
  stop_following();
  before_.reset();
  const v1::CrowdInfo* const crowd = current_crowd();
  if (camera_ && camera_->ortho && crowd != nullptr) {
    OrbitCamera goal = *camera_;
    goal.fit(point_of(crowd->low()), point_of(crowd->high()) + glm::dvec3(0.0, 0.0, 1.8),
             window_px_.x / window_px_.y);
    glide(goal);
    return;
  }
  glide_.reset();
  camera_.reset();
  if (!change_) change_.emplace();
  change_->clear_camera();
  change_->set_overview(true);
}

void Viewer::toggle_top_down() {
  OrbitCamera* const camera = held_camera();
  if (camera == nullptr) return;
  OrbitCamera goal = *camera;
  if (camera->ortho) {
    if (before_) goal = *before_;
    goal.target_world = camera->target_world;
    goal.distance_m = camera->distance_m;
    goal.ortho = false;
    if (!before_) goal.pitch_rad = 0.6;
    camera->ortho = false;
  } else {
    before_ = *camera;
    goal.pitch_rad = std::numbers::pi / 2.0;
    goal.yaw_rad = -std::numbers::pi / 2.0;  // north is up
    goal.ortho = true;
  }
  glide(goal, follow_);
}

void Viewer::release_agent() {
  card_.reset();
  if (follow_ == 0) return;
  follow_ = 0;
  if (!change_) change_.emplace();
  change_->set_follow_agent(0);
  add_camera(*change_);
  add_overlays(*change_);
}

void Viewer::stop_following() {
  if (glide_ && glide_->then_follow != 0) glide_.reset();
  release_agent();
}

// ---- time

void Viewer::toggle_play() {
  if (is_live_ || !is_paused_) {
    is_live_ = false;
    is_paused_ = true;
    change_playback().set_paused(true);
    return;
  }
  is_paused_ = false;
  v1::Playback& playback = change_playback();
  playback.set_paused(false);
  const v1::CrowdInfo* const crowd = current_crowd();
  const bool at_end = frame_ && time_us_ >= frame_->message.capture_time_us();
  if (at_end && crowd != nullptr && !crowd->live() && speed_ > 0.0) {
    playback.set_scene_time_us(frame_->message.oldest_time_us());
  }
}

void Viewer::go_live() {
  is_live_ = true;
  is_paused_ = false;
  speed_ = 1.0;
  v1::Playback& playback = change_playback();
  playback.Clear();
  playback.set_live(true);
}

void Viewer::step(int frames) {
  is_live_ = false;
  is_paused_ = true;
  v1::Playback& playback = change_playback();
  playback.set_step_frames(playback.step_frames() + frames);
}

void Viewer::choose_speed(double speed) {
  speed_ = speed;
  if (speed != 1.0) is_live_ = false;
  change_playback().set_speed(speed);
}

void Viewer::faster(int steps) {
  const auto* const at = std::find(std::begin(kSpeeds), std::end(kSpeeds), speed_);
  const std::ptrdiff_t now = at == std::end(kSpeeds) ? 3 : at - std::begin(kSpeeds);
  const std::ptrdiff_t last = std::end(kSpeeds) - std::begin(kSpeeds) - 1;
  choose_speed(kSpeeds[std::clamp<std::ptrdiff_t>(now + steps, 0, last)]);
}

void Viewer::seek(std::int64_t time_us) {
  is_live_ = false;
  time_us_ = time_us;
  change_playback().set_scene_time_us(time_us);
}

// ---- what is shown

const v1::CrowdInfo* Viewer::current_crowd() const {
  const auto found = std::find_if(crowds_.begin(), crowds_.end(),
                                  [&](const v1::CrowdInfo& one) { return one.name() == crowd_; });
  return found == crowds_.end() ? nullptr : &*found;
}

const v1::Channel* Viewer::current_channel() const {
  const v1::CrowdInfo* const crowd = current_crowd();
  if (crowd == nullptr) return nullptr;
  for (const v1::Channel& one : crowd->channels()) {
    if (one.name() == channel_) return &one;
  }
  return nullptr;
}

void Viewer::open_crowd(const std::string& name) {
  if (!crowd_.empty() && crowd_ != name) {
    camera_.reset();
    before_.reset();
    follow_ = 0;
    is_live_ = true;
    is_paused_ = false;
    channel_.clear();
  }
  glide_.reset();
  card_.reset();
  frame_.reset();
  agents_.clear();
  trails_.clear();
  latencies_ms_.clear();
  crowd_ = name;
  ask_all();
}

void Viewer::toggle(Overlay overlay) {
  overlays_.flip(static_cast<std::size_t>(overlay));
  if (overlay == Overlay::kTrails) trails_.clear();
  if (!change_) change_.emplace();
  add_overlays(*change_);
}

void Viewer::choose_channel(const std::string& name) {
  channel_ = name;
  range_is_auto_ = !name.empty();
  if (!change_) change_.emplace();
  add_channel(*change_);
  add_overlays(*change_);
}

void Viewer::next_channel() {
  const v1::CrowdInfo* const crowd = current_crowd();
  std::vector<std::string> names{""};
  if (crowd != nullptr) {
    for (const v1::Channel& one : crowd->channels()) names.push_back(one.name());
  }
  const auto at = std::find(names.begin(), names.end(), channel_);
  const std::size_t now = at == names.end() ? 0 : static_cast<std::size_t>(at - names.begin());
  choose_channel(names[(now + 1) % names.size()]);
}

void Viewer::choose_color_map(render::ColorMap map) {
  color_map_ = map;
  if (!change_) change_.emplace();
  add_channel(*change_);
}

void Viewer::set_range(double low, double high) {
  if (!(low < high)) {
    toast("The range must go from low to high");
    return;
  }
  low_ = low;
  high_ = high;
  if (!change_) change_.emplace();
  add_channel(*change_);
  add_overlays(*change_);
}

void Viewer::set_rate(double rate_hz) {
  rate_hz_ = rate_hz;
  if (!change_) change_.emplace();
  change_->set_max_rate_hz(rate_hz);
}

void Viewer::set_vertex_budget(std::uint64_t budget) {
  vertex_budget_ = budget;
  if (!change_) change_.emplace();
  change_->set_vertex_budget(budget);
}

void Viewer::set_sharpness(double sharpness) {
  sharpness_ = sharpness;
  if (!change_) change_.emplace();
  add_size(*change_);
}

void Viewer::set_shadows(bool enabled) {
  shadows_ = enabled;
  if (!change_) change_.emplace();
  change_->set_shadows(enabled);
}

std::string Viewer::banner() const {
  switch (link_state_) {
    case LinkState::kLost:
      return absl::StrCat("No answer from ", link_.address(), ". Trying again...");
    case LinkState::kWaiting:
      return absl::StrCat("Waiting for the crowd '", crowd_, "'...");
    case LinkState::kRefused:
      return absl::StrCat(link_message_, " (--token-file)");
    case LinkState::kConnecting:
    case LinkState::kOpen:
      break;
  }
  if (!knows_crowds_) return absl::StrCat("Connecting to ", link_.address(), "...");
  if (crowd_.empty() && !wanted_crowd_.empty()) {
    return absl::StrCat("Waiting for the crowd '", wanted_crowd_, "'...");
  }
  if (crowd_.empty() && crowds_.empty()) return "No crowd yet. Publish one and it shows here.";
  return {};
}

bool Viewer::is_settled() const {
  return frame_ && frame_->message.stamp() >= asked_stamp_ && !change_ && !script_ && !glide_;
}

Viewer::Numbers Viewer::numbers() const {
  Numbers numbers;
  if (shown_at_s_.size() > 1) {
    numbers.fps =
        static_cast<double>(shown_at_s_.size() - 1) / std::max(1e-3, now_s_ - shown_at_s_.front());
  }
  std::vector<double> sorted(latencies_ms_.begin(), latencies_ms_.end());
  std::sort(sorted.begin(), sorted.end());
  if (!sorted.empty()) {
    numbers.latency_ms = sorted[sorted.size() / 2];
    numbers.worst_latency_ms = sorted.back();
  }
  numbers.mbit_per_s = mbit_per_s_;
  numbers.shown = shown_;
  numbers.left_out = link_.status().left_out;
  return numbers;
}

std::string Viewer::state_json() const {
  using Json = nlohmann::ordered_json;
  const OrbitCamera camera = camera_.value_or(shown_camera_);
  Json overlays = Json::array();
  for (std::size_t i = 0; i < kOverlays; ++i) {
    if (overlays_.test(i)) overlays.push_back(kOverlayNames[i]);
  }
  const Numbers numbers = this->numbers();
  const auto list = [](const glm::dvec3& p) { return Json::array({p.x, p.y, p.z}); };
  ViewText view{crowd_,   camera_, follow_,    {}, is_live_ ? 1.0 : speed_,
                channel_, {},      color_map_, {}};
  for (const Json& name : overlays) view.show.push_back(name.get<std::string>());
  if (!is_live_) view.time_us = time_us_;
  if (low_ < high_) view.range = {low_, high_};
  std::sort(view.show.begin(), view.show.end());
  const Json state = {{"crowd", crowd_},
                      {"view", format_view_text(view)},
                      {"link", name_of(link_state_)},
                      {"banner", banner()},
                      {"frames", shown_},
                      {"agents", frame_ ? frame_->message.stats().agents() : 0},
                      {"visible", frame_ ? frame_->message.stats().visible() : 0},
                      {"agent_columns", agents_.size()},
                      {"width_px", frame_ ? frame_->image->width_px : 0},
                      {"height_px", frame_ ? frame_->image->height_px : 0},
                      {"live", is_live_},
                      {"paused", paused()},
                      {"speed", speed_},
                      {"time_s", static_cast<double>(time_us_) * 1e-6},
                      // the picture is of the time that was asked for
                      {"settled", frame_ && frame_->message.stamp() >= playback_stamp_},
                      {"follow", follow_},
                      {"followed", frame_ ? frame_->message.followed_agent() : 0},
                      {"card", card_ ? card_->id() : 0},
                      {"channel", channel_},
                      {"color_map", render::name_of(color_map_)},
                      {"low", low_},
                      {"high", high_},
                      {"overlays", overlays},
                      {"gliding", glide_.has_value()},
                      {"overview", !camera_.has_value()},
                      {"ortho", camera.ortho},
                      {"eye", list(camera.eye_world())},
                      {"target", list(camera.target_world)},
                      {"distance_m", camera.distance_m},
                      {"yaw_rad", camera.yaw_rad},
                      {"pitch_rad", camera.pitch_rad},
                      {"fps", numbers.fps},
                      {"latency_ms", numbers.latency_ms},
                      {"left_out", numbers.left_out},
                      {"skipped", frame_ ? frame_->message.skipped_frames() : 0}};
  return state.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace throng::client
