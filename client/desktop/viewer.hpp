#pragma once

#include <bitset>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/camera/camera_script.hpp"
#include "client/desktop/agents.hpp"
#include "client/desktop/orbit_camera.hpp"
#include "client/desktop/view_link.hpp"
#include "throng/render/color_map.hpp"

namespace throng::client {

enum class Overlay : std::size_t { kIds, kTrails, kDensity, kGrid, kScale, kTime };
inline constexpr std::size_t kOverlays = 6;
extern const char* const kOverlayNames[kOverlays];

/// What a viewer wants to see from the start.
struct ViewerSettings {
  std::string crowd;  // empty: the only one there is, or the one that is chosen
  std::uint64_t follow = 0;
  std::string channel;
  std::optional<std::pair<double, double>> range;  // of the channel; none: what is in view
  render::ColorMap color_map = render::ColorMap::kViridis;
  std::optional<CameraScript> camera;   // where it begins; none: an overview
  std::optional<OrbitCamera> held;      // the same as the hand has left it
  std::optional<std::int64_t> time_us;  // paused there; none: live
  double speed = 1.0;
  double rate_hz = 30.0;
  std::uint64_t vertex_budget = 0;
  double sharpness = 1.0;  // pixels drawn for each of the window's, along a side
  std::bitset<kOverlays> overlays;
};

/// What is wanted and what is shown: everything of a viewer but its window. One thread. Times are
/// seconds of any steady clock; places are pixels of the window.
class Viewer {
 public:
  Viewer(ViewLink& link, const ViewerSettings& settings);

  /// Fetches what has come, moves what moves, and tells the server of changes.
  /// True where the window must be drawn again.
  bool update(double now_s, const glm::dvec2& window_px);

  // the camera
  OrbitCamera* held_camera();  // null before the first frame
  void camera_moved();
  void drag(const glm::dvec2& from_px, const glm::dvec2& to_px, bool pans);
  void zoom_at(double factor, const glm::dvec2& place_px);
  void click(const glm::dvec2& place_px);
  struct Flight {
    double ahead = 0, right = 0, up = 0, turn = 0, tilt = 0, zoom = 0;  // -1 to 1
    bool fast = false;
    bool any() const {
      return ahead != 0 || right != 0 || up != 0 || turn != 0 || tilt != 0 || zoom != 0;
    }
  };
  void fly(const Flight& flight, double seconds, double held_s);
  void fit();
  void toggle_top_down();
  void stop_following();

  // time
  void toggle_play();
  void go_live();
  void step(int frames);
  void choose_speed(double speed);
  void faster(int steps);
  void seek(std::int64_t time_us);

  // what is shown
  void open_crowd(const std::string& name);
  void toggle(Overlay overlay);
  void choose_channel(const std::string& name);
  void next_channel();
  void choose_color_map(render::ColorMap map);
  void set_range(double low, double high);
  void fit_range() { range_is_auto_ = true; }
  void set_rate(double rate_hz);
  void set_vertex_budget(std::uint64_t budget);
  void set_sharpness(double sharpness);
  void set_shadows(bool enabled);
  void toast(const std::string& text) { toast_ = text, toast_until_s_ = now_s_ + 3.0; }
  void retry_now() { link_.retry_now(); }

  // what to draw
  const ReceivedFrame* frame() const { return frame_ ? &*frame_ : nullptr; }
  const OrbitCamera& shown_camera() const { return shown_camera_; }
  const std::vector<Agent>& agents() const { return agents_; }
  const Trails& trails() const { return trails_; }
  const std::vector<v1::CrowdInfo>& crowds() const { return crowds_; }
  const v1::CrowdInfo* current_crowd() const;
  const v1::Channel* current_channel() const;
  const v1::PickAgentResponse* card() const { return card_ ? &*card_ : nullptr; }
  const std::string& crowd() const { return crowd_; }
  const std::string& channel() const { return channel_; }
  const std::string& rasterizer() const { return rasterizer_; }
  render::ColorMap color_map() const { return color_map_; }
  double low() const { return low_; }
  double high() const { return high_; }
  double speed() const { return speed_; }
  double rate_hz() const { return rate_hz_; }
  std::uint64_t vertex_budget() const { return vertex_budget_; }
  double sharpness() const { return sharpness_; }
  bool shadows() const { return shadows_; }
  bool shows(Overlay overlay) const { return overlays_.test(static_cast<std::size_t>(overlay)); }
  bool live() const { return is_live_; }
  bool paused() const { return is_paused_ && !is_live_; }
  std::uint64_t followed() const { return follow_; }
  double ground_z_m() const;
  std::string banner() const;  // empty: nothing is wrong
  std::string toast() const { return now_s_ < toast_until_s_ ? toast_ : std::string(); }

  /// How the picture lies on the window: it covers it and keeps its shape.
  struct Placement {
    glm::dvec2 corner_px{0.0}, size_px{1.0};
    double factor = 1.0;  // window pixels for each of the picture
  };
  Placement placement() const;

  /// The picture is what was asked for last.
  bool is_settled() const;

  struct Numbers {
    double fps = 0.0, latency_ms = 0.0, worst_latency_ms = 0.0, mbit_per_s = 0.0;
    std::uint64_t shown = 0, left_out = 0;
  };
  Numbers numbers() const;

  /// Everything a script may want to know, as one line of JSON.
  std::string state_json() const;

 private:
  void take_frame(ReceivedFrame frame);
  void refresh_crowds();
  void ask_all();
  void flush();
  v1::ViewOptions whole() const;
  void add_camera(v1::ViewOptions& options) const;
  void add_channel(v1::ViewOptions& options) const;
  void add_overlays(v1::ViewOptions& options) const;
  void add_size(v1::ViewOptions& options) const;
  v1::Playback& change_playback();
  void glide(const OrbitCamera& goal, std::uint64_t then_follow = 0);
  void release_agent();
  void choose_range();

  ViewLink& link_;
  double now_s_ = 0.0;
  glm::dvec2 window_px_{1280.0, 720.0}, asked_px_{0.0};

  std::string crowd_, wanted_crowd_, channel_, rasterizer_;
  std::optional<OrbitCamera> camera_;   // none: the server's overview
  std::optional<CameraScript> script_;  // that waits for the first frame, to know the site
  std::optional<OrbitCamera> before_;   // before looking from above
  std::uint64_t follow_ = 0;
  bool is_live_ = true, is_paused_ = false, shadows_ = true, range_is_auto_ = false;
  render::ColorMap color_map_ = render::ColorMap::kViridis;
  double speed_ = 1.0, low_ = 0.0, high_ = 2.0, rate_hz_ = 30.0;
  std::int64_t time_us_ = 0;
  std::uint64_t vertex_budget_ = 0;
  double sharpness_ = 1.0;
  std::bitset<kOverlays> overlays_;

  struct Glide {
    OrbitCamera from, to;
    double began_s;
    std::uint64_t then_follow;
  };
  std::optional<Glide> glide_;

  std::optional<v1::ViewOptions> change_;
  std::uint64_t last_stamp_ = 0, playback_stamp_ = 0, crowd_stamp_ = 0, measured_stamp_ = 0,
                follow_stamp_ = 0, asked_stamp_ = 0;
  double next_stamp_s_ = 0.0, next_crowds_s_ = 0.0, next_card_s_ = 0.0, next_rate_s_ = 0.0;

  std::optional<ReceivedFrame> frame_;
  OrbitCamera shown_camera_;
  std::vector<Agent> agents_;
  Trails trails_;
  std::vector<v1::CrowdInfo> crowds_;
  bool knows_crowds_ = false, has_limits_ = false;
  v1::Limits limits_;
  std::optional<v1::PickAgentResponse> card_;
  LinkState link_state_ = LinkState::kConnecting;
  std::string link_message_, toast_;
  double toast_until_s_ = -1.0;

  std::deque<double> shown_at_s_, latencies_ms_;
  std::uint64_t shown_ = 0, bytes_before_ = 0;
  double mbit_per_s_ = 0.0;
};

/// 1:02:03.4
std::string format_time(std::int64_t time_us);
/// Three digits.
std::string format_number(double value);

}  // namespace throng::client
