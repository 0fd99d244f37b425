#include "client/desktop/panels.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "client/desktop/viewer.hpp"

namespace throng::client {
namespace {

/// Everything grows with the font, which is as large as the screen is fine.
float scaled(float px) { return px * ImGui::GetFontSize() / kFontPx; }
float edge_px() { return scaled(12.0F); }
float player_px() { return scaled(48.0F); }
float bar_px() { return scaled(46.0F); }
constexpr ImGuiWindowFlags kFixed = ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize |
                                    ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoSavedSettings |
                                    ImGuiWindowFlags_NoScrollbar | ImGuiWindowFlags_NoNav |
                                    ImGuiWindowFlags_NoFocusOnAppearing;
const ImVec4 kAccent(0.43F, 0.90F, 0.80F, 1.0F), kDimText(0.73F, 0.78F, 0.83F, 1.0F);

std::string people(std::uint32_t count) {
  return absl::StrCat(count, count == 1 ? " person" : " people");
}
std::string many(std::uint64_t value) {
  if (value >= 1'000'000) return absl::StrFormat("%.2f M", static_cast<double>(value) * 1e-6);
  if (value >= 10'000) return absl::StrFormat("%d k", (value + 500) / 1000);
  return absl::StrCat(value);
}
std::string in_ms(double ms) { return absl::StrFormat(ms < 10 ? "%.1f ms" : "%.0f ms", ms); }

void tip(const char* text) {
  if (ImGui::IsItemHovered()) ImGui::SetTooltip("%s", text);
}

bool button(const char* text, const char* what, bool is_on = false) {
  if (is_on) ImGui::PushStyleColor(ImGuiCol_Button, ImVec4(0.16F, 0.45F, 0.42F, 1.0F));
  const bool pressed = ImGui::Button(text);
  if (is_on) ImGui::PopStyleColor();
  tip(what);
  return pressed;
}

bool begin_rows(float name_width_px) {
  if (!ImGui::BeginTable("rows", 2)) return false;
  ImGui::TableSetupColumn("name", ImGuiTableColumnFlags_WidthFixed, name_width_px);
  ImGui::TableSetupColumn("value", ImGuiTableColumnFlags_WidthStretch);
  return true;
}

void row(const char* name, const std::string& value) {
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::TextColored(kDimText, "%s", name);
  ImGui::TableNextColumn();
  ImGui::TextUnformatted(value.c_str());
}

void draw_crowds(Viewer& viewer) {
  ImGui::SetNextWindowPos({edge_px(), edge_px()});
  ImGui::SetNextWindowSize({0, 0});
  ImGui::Begin("crowd", nullptr, kFixed | ImGuiWindowFlags_AlwaysAutoResize);
  const std::string now = viewer.crowd().empty() ? "Choose a crowd" : viewer.crowd();
  const bool is_narrow = ImGui::GetIO().DisplaySize.x < scaled(900.0F);
  ImGui::SetNextItemWidth(scaled(is_narrow ? 120.0F : 190.0F));
  if (ImGui::BeginCombo("##crowds", now.c_str())) {
    for (const v1::CrowdInfo& crowd : viewer.crowds()) {
      const std::string line =
          absl::StrCat(crowd.name(), "   ", people(crowd.agents()), crowd.live() ? "" : ", ended");
      if (ImGui::Selectable(line.c_str(), crowd.name() == viewer.crowd())) {
        viewer.open_crowd(crowd.name());
        break;  // the list may be another one now
      }
    }
    if (viewer.crowds().empty()) ImGui::TextColored(kDimText, "none yet");
    ImGui::EndCombo();
  }
  if (viewer.frame() != nullptr && !is_narrow) {
    ImGui::SameLine();
    ImGui::AlignTextToFramePadding();
    ImGui::TextColored(kDimText, "%s", people(viewer.frame()->message.stats().agents()).c_str());
  }
  ImGui::End();
}

void draw_tools(Viewer& viewer, Panels& panels) {
  const ImVec2 window = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({window.x - edge_px(), edge_px()}, 0, {1, 0});
  ImGui::Begin("tools", nullptr, kFixed | ImGuiWindowFlags_AlwaysAutoResize);
  if (button("Fit", "Fit to crowd (F)")) viewer.fit();
  ImGui::SameLine();
  const bool ortho = viewer.frame() != nullptr && viewer.shown_camera().ortho;
  if (button("Top", "From above, orthographic (T)", ortho)) viewer.toggle_top_down();
  ImGui::SameLine();
  if (button("Display", "Colours and overlays (O)", panels.display)) {
    panels.display = !panels.display;
  }
  ImGui::SameLine();
  if (button("Numbers", "Numbers (X)", panels.numbers)) panels.numbers = !panels.numbers;
  ImGui::SameLine();
  if (button("Picture", "Save a picture (P)")) panels.wants_picture = true;
  ImGui::SameLine();
  if (button("Record", "Record a video (R)", panels.recording)) panels.wants_recording = true;
  ImGui::SameLine();
  if (button("?", "Help (?)", panels.help)) panels.help = !panels.help;
  ImGui::End();
}

void draw_display(Viewer& viewer, Panels& panels) {
  ImGui::SetNextWindowPos({ImGui::GetIO().DisplaySize.x - edge_px(), edge_px() + bar_px() + 8}, 0,
                          {1, 0});
  ImGui::SetNextWindowSize({286, 0});
  ImGui::Begin("display", &panels.display, kFixed);
  ImGui::TextColored(kAccent, "Colour");
  ImGui::SetNextItemWidth(-1);
  const char* const as_they_are = "as they are";
  if (ImGui::BeginCombo("##channel",
                        viewer.channel().empty() ? as_they_are : viewer.channel().c_str())) {
    if (ImGui::Selectable(as_they_are, viewer.channel().empty())) viewer.choose_channel("");
    if (const v1::CrowdInfo* crowd = viewer.current_crowd()) {
      for (const v1::Channel& one : crowd->channels()) {
        const std::string line =
            one.unit().empty() ? one.name() : absl::StrCat(one.name(), " (", one.unit(), ")");
        if (ImGui::Selectable(line.c_str(), one.name() == viewer.channel())) {
          viewer.choose_channel(one.name());
        }
      }
    }
    ImGui::EndCombo();
  }
  if (!viewer.channel().empty()) {
    double range[2] = {viewer.low(), viewer.high()};
    ImGui::SetNextItemWidth(200);
    ImGui::InputScalarN("##range", ImGuiDataType_Double, range, 2, nullptr, nullptr, "%.4g");
    if (ImGui::IsItemDeactivatedAfterEdit()) viewer.set_range(range[0], range[1]);
    ImGui::SameLine();
    if (button("Auto", "Range of the people in view")) viewer.fit_range();
    ImGui::SetNextItemWidth(140);
    if (ImGui::BeginCombo("colours", render::name_of(viewer.color_map()))) {
      for (std::size_t i = 0; i < render::kColorMapNames.size(); ++i) {
        const auto map = static_cast<render::ColorMap>(i);
        if (ImGui::Selectable(render::name_of(map), map == viewer.color_map())) {
          viewer.choose_color_map(map);
        }
      }
      ImGui::EndCombo();
    }
  }
  ImGui::Spacing();
  ImGui::TextColored(kAccent, "Over the picture");
  static const char* const kLabels[kOverlays] = {"Ids (I)",  "Trails (V)",    "Density (M)",
                                                 "Grid (G)", "Scale bar (B)", "Time (K)"};
  for (std::size_t i = 0; i < kOverlays; ++i) {
    bool shown = viewer.shows(static_cast<Overlay>(i));
    if (i % 2 == 1) ImGui::SameLine(140);
    if (ImGui::Checkbox(kLabels[i], &shown)) viewer.toggle(static_cast<Overlay>(i));
  }
  ImGui::Spacing();
  ImGui::TextColored(kAccent, "Picture");
  static constexpr std::uint64_t kBudgets[] = {0, 100'000, 1'000'000, 5'000'000};
  static const char* const kBudgetNames[] = {"automatic", "100 thousand", "1 million", "5 million"};
  int budget = 0;
  for (int i = 0; i < 4; ++i) {
    if (kBudgets[i] == viewer.vertex_budget()) budget = i;
  }
  ImGui::SetNextItemWidth(140);
  if (ImGui::Combo("vertices", &budget, kBudgetNames, 4)) {
    viewer.set_vertex_budget(kBudgets[budget]);
  }
  static constexpr double kSharpness[] = {0.5, 1.0, 2.0};
  static const char* const kSharpnessNames[] = {"half", "normal", "fine"};
  int sharpness = viewer.sharpness() < 1.0 ? 0 : (viewer.sharpness() > 1.0 ? 2 : 1);
  ImGui::SetNextItemWidth(140);
  if (ImGui::Combo("sharpness", &sharpness, kSharpnessNames, 3)) {
    viewer.set_sharpness(kSharpness[sharpness]);
  }
  auto rate = static_cast<int>(std::lround(viewer.rate_hz()));
  ImGui::SetNextItemWidth(140);
  if (ImGui::SliderInt("frames / s", &rate, 1, 60)) viewer.set_rate(rate);
  bool shadows = viewer.shadows();
  if (ImGui::Checkbox("Shadows", &shadows)) viewer.set_shadows(shadows);
  ImGui::End();
}

void draw_numbers(const Viewer& viewer) {
  if (viewer.frame() == nullptr) return;
  const v1::StreamViewResponse& message = viewer.frame()->message;
  const v1::FrameStats& stats = message.stats();
  const v1::StageTimes& times = stats.times();
  const Viewer::Numbers numbers = viewer.numbers();
  ImGui::SetNextWindowPos({edge_px(), edge_px() + bar_px() + 8});
  ImGui::SetNextWindowSize({286, 0});
  ImGui::Begin("numbers", nullptr, kFixed);
  if (begin_rows(165)) {
    row("Frames per second", absl::StrFormat("%.1f", numbers.fps));
    row("Latency, median", in_ms(numbers.latency_ms));
    row("Latency, worst of 60", in_ms(numbers.worst_latency_ms));
    row("Skipped by the server", absl::StrCat(message.skipped_frames()));
    row("Left out here", absl::StrCat(numbers.left_out));
    row("Data", absl::StrFormat("%.1f Mbit/s", numbers.mbit_per_s));
    const double drawing_ms = times.advance_ms() + times.cull_ms() + times.select_ms() +
                              times.allocate_ms() + times.generate_ms() + times.raster_ms() +
                              times.resolve_ms() + times.read_back_ms();
    row("Drawing", stats.target_ms() > 0.0
                       ? absl::StrCat(in_ms(drawing_ms), " of ", in_ms(stats.target_ms()))
                       : in_ms(drawing_ms));
    row("Encoding", in_ms(times.encode_ms()));
    row("Agents", many(stats.agents()));
    row("In view", many(stats.visible()));
    row("As meshes", many(stats.as_meshes()));
    const std::pair<const char*, std::uint32_t> others[] = {{"As small figures", stats.as_specks()},
                                                            {"As impostors", stats.as_impostors()},
                                                            {"As points", stats.as_points()},
                                                            {"Left to others", stats.left_out()}};
    for (const auto& [name, count] : others) {
      if (count > 0) row(name, many(count));
    }
    row("Triangles", many(stats.triangles()));
    row("Vertices", absl::StrCat(many(stats.vertices()), " of ", many(stats.effective_budget())));
    row("Detail", stats.in_full()           ? "all of it"
                  : stats.error_px() > 0.0F ? absl::StrFormat("to %.2g px", stats.error_px())
                                            : "as budgeted");
    row("Samples a pixel", stats.oversampling() == 2 ? "16" : "4");
    row("Picture", absl::StrCat(message.width_px(), " x ", message.height_px()));
    row("Rasterizer", viewer.rasterizer().substr(0, viewer.rasterizer().find(' ')));
    ImGui::EndTable();
  }
  ImGui::End();
}

void draw_card(Viewer& viewer, const Panels& panels) {
  const v1::PickAgentResponse* const agent = viewer.card();
  if (agent == nullptr) return;
  const float top = panels.numbers ? scaled(560.0F) : edge_px() + bar_px() + 8;
  ImGui::SetNextWindowPos({edge_px(), top});
  ImGui::SetNextWindowSize({286, 0});
  ImGui::Begin("agent", nullptr, kFixed);
  ImGui::TextColored(kAccent, "Agent %s", absl::StrCat(agent->id()).c_str());
  bool lets_go = false;
  ImGui::SameLine(200);
  if (button("Let go", "Stop following (Esc)")) lets_go = true;
  if (begin_rows(95)) {
    row("speed", absl::StrFormat("%.2f m/s", agent->speed_mps()));
    if (std::isfinite(agent->heading_rad())) {
      const double degrees = agent->heading_rad() * 180.0 / std::numbers::pi;
      row("heading", absl::StrFormat("%.0f\xc2\xb0", std::fmod(degrees + 360.0, 360.0)));
    }
    row("position", absl::StrFormat("%.1f, %.1f m", agent->position().x(), agent->position().y()));
    for (const v1::NamedValue& one : agent->values()) {
      if (one.channel().name() == "speed") continue;  // the first row
      row(one.channel().name().c_str(),
          absl::StrCat(format_number(one.value()), " ", one.channel().unit()));
    }
    if (!agent->character().empty()) row("character", agent->character());
    ImGui::EndTable();
  }
  ImGui::End();
  if (lets_go) viewer.stop_following();
}

void draw_player(Viewer& viewer) {
  if (viewer.frame() == nullptr) return;
  const v1::StreamViewResponse& message = viewer.frame()->message;
  const ImVec2 window = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({edge_px(), window.y - edge_px()}, 0, {0, 1});
  ImGui::SetNextWindowSize({window.x - 2 * edge_px(), player_px()});
  ImGui::Begin("player", nullptr, kFixed);
  if (button("|<", "One frame back (,)")) viewer.step(-1);
  ImGui::SameLine();
  if (button(viewer.paused() ? "Play" : "Pause", "Play or pause (Space)")) viewer.toggle_play();
  ImGui::SameLine();
  if (button(">|", "One frame on (.)")) viewer.step(1);
  ImGui::SameLine();
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted(format_time(message.scene_time_us()).c_str());
  ImGui::SameLine();
  const double oldest_s = static_cast<double>(message.oldest_time_us()) * 1e-6;
  const double newest_s = static_cast<double>(message.capture_time_us()) * 1e-6;
  double time_s = std::clamp(static_cast<double>(message.scene_time_us()) * 1e-6, oldest_s,
                             std::max(oldest_s, newest_s));
  ImGui::SetNextItemWidth(
      std::max(scaled(60.0F), ImGui::GetContentRegionAvail().x - scaled(240.0F)));
  if (ImGui::SliderScalar("##time", ImGuiDataType_Double, &time_s, &oldest_s, &newest_s, "")) {
    viewer.seek(std::llround(time_s * 1e6));
  }
  tip("Time");
  ImGui::SameLine();
  ImGui::TextColored(kDimText, "%s", format_time(message.capture_time_us()).c_str());
  ImGui::SameLine();
  if (button(message.live() ? "Live" : "End", "To the live edge (L)", viewer.live())) {
    viewer.go_live();
  }
  ImGui::SameLine();
  static constexpr double kSpeeds[] = {-1, 0.1, 0.25, 0.5, 1, 2, 4, 8};
  ImGui::SetNextItemWidth(-1);
  if (ImGui::BeginCombo("##speed", absl::StrCat(viewer.speed(), "x").c_str())) {
    for (const double speed : kSpeeds) {
      if (ImGui::Selectable(absl::StrCat(speed, "x").c_str(), speed == viewer.speed())) {
        viewer.choose_speed(speed);
      }
    }
    ImGui::EndCombo();
  }
  ImGui::End();
}

void draw_note(const char* name, const std::string& text, float y, Viewer* with_retry) {
  if (text.empty()) return;
  ImGui::SetNextWindowPos({ImGui::GetIO().DisplaySize.x / 2, y}, 0, {0.5F, 0});
  ImGui::Begin(name, nullptr, kFixed | ImGuiWindowFlags_AlwaysAutoResize);
  ImGui::AlignTextToFramePadding();
  ImGui::TextUnformatted(text.c_str());
  if (with_retry != nullptr) {
    ImGui::SameLine();
    if (ImGui::Button("Try now")) with_retry->retry_now();
  }
  ImGui::End();
}

void draw_help(Panels& panels) {
  const ImVec2 window = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({window.x / 2, window.y / 2}, 0, {0.5F, 0.5F});
  ImGui::SetNextWindowFocus();
  ImGui::Begin("help", &panels.help, kFixed | ImGuiWindowFlags_AlwaysAutoResize);
  struct Line {
    const char *keys, *what;
  };
  static constexpr Line kHelp[] = {{nullptr, "Mouse"},
                                   {"drag", "turn"},
                                   {"right or Shift drag", "move"},
                                   {"wheel", "nearer to the pointer"},
                                   {"click a person", "follow"},
                                   {nullptr, "Camera"},
                                   {"W A S D", "fly"},
                                   {"Q E", "down, up"},
                                   {"Shift", "faster"},
                                   {"arrows", "turn"},
                                   {"+ -", "nearer, farther"},
                                   {"F or Home", "fit to crowd"},
                                   {"T", "from above"},
                                   {"Esc", "let go"},
                                   {nullptr, "Time"},
                                   {"Space", "play, pause"},
                                   {", .", "one frame"},
                                   {"[ ]", "slower, faster"},
                                   {"L or End", "live"},
                                   {nullptr, "Picture"},
                                   {"C", "next colour"},
                                   {"I V M", "ids, trails, density"},
                                   {"G B K", "grid, scale, time"},
                                   {"O", "all of these"},
                                   {"X", "numbers"},
                                   {"P", "save a picture"},
                                   {"R", "record a video"},
                                   {"? or H", "this"}};
  if (ImGui::BeginTable("help", 4, ImGuiTableFlags_SizingFixedFit)) {
    // two columns of lines, the second from Time on
    constexpr std::size_t kFirst = 14, kAll = std::size(kHelp);
    const auto cell = [](const Line* line) {
      ImGui::TableNextColumn();
      if (line != nullptr && line->keys != nullptr) ImGui::TextUnformatted(line->keys);
      if (line != nullptr && line->keys == nullptr) ImGui::TextColored(kAccent, "%s", line->what);
      ImGui::TableNextColumn();
      if (line != nullptr && line->keys != nullptr)
        ImGui::TextColored(kDimText, "%s      ", line->what);
    };
    for (std::size_t i = 0; i < kFirst; ++i) {
      ImGui::TableNextRow();
      cell(&kHelp[i]);
      cell(kFirst + i < kAll ? &kHelp[kFirst + i] : nullptr);
    }
    ImGui::EndTable();
  }
  ImGui::End();
}

}  // namespace

void set_style() {
  ImGui::StyleColorsDark();
  ImGuiStyle& style = ImGui::GetStyle();
  style.WindowRounding = 9;
  style.FrameRounding = style.PopupRounding = style.GrabRounding = 6;
  style.WindowBorderSize = 0;
  style.WindowPadding = {10, 9};
  style.FramePadding = {9, 5};
  style.GrabMinSize = 14;
  style.Colors[ImGuiCol_WindowBg] = {0.06F, 0.085F, 0.125F, 0.84F};
  style.Colors[ImGuiCol_PopupBg] = {0.06F, 0.085F, 0.125F, 0.97F};
  style.Colors[ImGuiCol_Button] = style.Colors[ImGuiCol_FrameBg] = {0.16F, 0.21F, 0.28F, 0.95F};
  style.Colors[ImGuiCol_ButtonHovered] = style.Colors[ImGuiCol_FrameBgHovered] =
      style.Colors[ImGuiCol_HeaderHovered] = {0.22F, 0.30F, 0.38F, 1.0F};
  style.Colors[ImGuiCol_ButtonActive] = style.Colors[ImGuiCol_FrameBgActive] =
      style.Colors[ImGuiCol_Header] = {0.16F, 0.45F, 0.42F, 1.0F};
  style.Colors[ImGuiCol_CheckMark] = style.Colors[ImGuiCol_SliderGrab] =
      style.Colors[ImGuiCol_SliderGrabActive] = kAccent;
}

Insets panel_insets() {
  return {double{edge_px() + bar_px()} + 8, double{edge_px()}, double{edge_px() + player_px()} + 8,
          double{edge_px()}};
}

void draw_panels(Viewer& viewer, Panels& panels) {
  draw_crowds(viewer);
  draw_tools(viewer, panels);
  draw_player(viewer);
  if (panels.display) draw_display(viewer, panels);
  if (panels.numbers) draw_numbers(viewer);
  draw_card(viewer, panels);
  const std::string banner = viewer.banner();
  draw_note("banner", banner, edge_px() + bar_px() + 8, &viewer);
  draw_note("toast", viewer.toast(),
            edge_px() + bar_px() + (banner.empty() ? scaled(8.0F) : scaled(16.0F) + bar_px()),
            nullptr);
  if (panels.help) draw_help(panels);
}

}  // namespace throng::client
