#include "client/desktop/window.hpp"

#include <SDL.h>
#include <absl/strings/str_cat.h>
#include <backends/imgui_impl_sdl.h>
#include <dlfcn.h>
#include <imgui.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string_view>

#include "client/desktop/gui_renderer.hpp"
#include "client/desktop/overlays.hpp"
#include "client/desktop/panels.hpp"
#include "client/desktop/recorder.hpp"
#include "throng/render/encode.hpp"

namespace throng::client {
namespace {

constexpr double kClickPx = 5.0;
constexpr int kIdleMs = 50;  // how long nothing is looked at while nothing happens
constexpr double kWheelStep = 0.16;

struct SdlDeleter {
  void operator()(SDL_Window* window) const { SDL_DestroyWindow(window); }
  void operator()(SDL_Renderer* renderer) const { SDL_DestroyRenderer(renderer); }
  void operator()(SDL_Texture* texture) const { SDL_DestroyTexture(texture); }
};
template <typename T>
using Sdl = std::unique_ptr<T, SdlDeleter>;

absl::Status sdl_failed(const char* call) {
  return absl::UnavailableError(absl::StrCat(call, ": ", SDL_GetError()));
}

/// What SDL and ImGui have to be told when they are done with.
struct Library {
  bool has_imgui = false, has_platform = false;
  ~Library() {
    if (has_platform) ImGui_ImplSDL2_Shutdown();
    if (has_imgui) ImGui::DestroyContext();
  }
};
struct SdlLibrary {
  ~SdlLibrary() { SDL_Quit(); }
};

class Window {
 public:
  explicit Window(const WindowSettings& settings)
      : settings_(settings), is_hidden_(!settings.screenshot.empty() || !settings.script.empty()) {}

  absl::Status run();

 private:
  absl::Status open();
  absl::Status loop();
  void handle(const SDL_Event& event);
  void handle_key(const SDL_Keysym& key, bool is_repeat);
  void handle_up(const SDL_MouseButtonEvent& event);
  void fly();
  absl::Status draw();
  absl::Status upload_picture();
  absl::StatusOr<bool> play();
  void push_pointer();
  glm::dvec2 size_px() const {
    int width = 1, height = 1;
    SDL_GetRendererOutputSize(renderer_.get(), &width, &height);
    return {width, height};
  }
  double now_s() const {
    return static_cast<double>(SDL_GetPerformanceCounter()) /
           static_cast<double>(SDL_GetPerformanceFrequency());
  }
  absl::Status save(const std::string& path);
  absl::Status save_picture();
  /// Where P and R save: named by crowd and scene time.
  std::string path_with(const char* ending) const;
  void toggle_recording();
  void record();

  const WindowSettings& settings_;
  const bool is_hidden_;
  // in the order in which they are made; they go the other way
  SdlLibrary sdl_;
  Sdl<SDL_Window> window_;
  Sdl<SDL_Renderer> renderer_;
  Library library_;
  GuiRenderer gui_;
  Sdl<SDL_Texture> texture_;
  int texture_width_ = 0, texture_height_ = 0;
  std::shared_ptr<const render::DecodedImage> uploaded_;
  ImFont* font_ = nullptr;
  std::uint32_t wake_event_ = 0;

  std::unique_ptr<ViewLink> link_;
  std::unique_ptr<Viewer> viewer_;
  Panels panels_;
  Recorder recorder_;
  bool is_done_ = false;

  // the pointer
  bool is_down_ = false, has_moved_ = false, pans_ = false;
  int button_ = 0;
  glm::dvec2 start_px_{0.0}, last_px_{0.0};

  // keys that are held
  double flying_since_s_ = -1.0, flown_s_ = 0.0;
  std::vector<SDL_Keycode> held_;
  bool is_fast_ = false;

  // the script
  std::size_t next_step_ = 0;
  double step_since_s_ = 0.0;
  glm::dvec2 pointer_px_{-1e6};
  bool pointer_down_[2] = {false, false};
  std::string screenshot_path_;
};

/// Dots an inch as X tells them where SDL does not know: what the desktop set for text (Xft.dpi),
/// else by the screen's millimetres. 0: not known. Loaded at run time, as SDL itself does it.
double dots_per_inch_of_x() {
  const std::unique_ptr<void, int (*)(void*)> library(dlopen("libX11.so.6", RTLD_LAZY), &dlclose);
  if (library == nullptr) return 0.0;
  const auto symbol = [&](const char* name) { return dlsym(library.get(), name); };
  const auto open = reinterpret_cast<void* (*)(const char*)>(symbol("XOpenDisplay"));
  const auto close = reinterpret_cast<int (*)(void*)>(symbol("XCloseDisplay"));
  const auto resource =
      reinterpret_cast<char* (*)(void*, const char*, const char*)>(symbol("XGetDefault"));
  const auto width_px = reinterpret_cast<int (*)(void*, int)>(symbol("XDisplayWidth"));
  const auto width_mm = reinterpret_cast<int (*)(void*, int)>(symbol("XDisplayWidthMM"));
  if (!open || !close || !resource || !width_px || !width_mm) return 0.0;
  void* const display = open(nullptr);
  if (display == nullptr) return 0.0;
  const char* const text = resource(display, "Xft", "dpi");
  double dots = text != nullptr ? std::atof(text) : 0.0;
  if (!(dots > 0.0)) dots = 25.4 * width_px(display, 0) / std::max(1, width_mm(display, 0));
  close(display);
  return dots;
}

/// How much larger things must be than on a screen of 96 dots an inch, in quarters.
double scale_of_screen(SDL_Window* window) {
  float told = 0.0F;
  double dots_per_inch = 0.0;
  if (SDL_GetDisplayDPI(SDL_GetWindowDisplayIndex(window), nullptr, &told, nullptr) == 0) {
    dots_per_inch = double{told};
  } else if (const char* driver = SDL_GetCurrentVideoDriver();
             driver != nullptr && std::string_view(driver) == "x11") {
    dots_per_inch = dots_per_inch_of_x();
  }
  return std::clamp(std::floor(dots_per_inch / 96.0 * 4.0 + 0.5) / 4.0, 1.0, 4.0);
}

absl::Status Window::open() {
  // without a screen a hidden window still draws
  if (is_hidden_ && std::getenv("DISPLAY") == nullptr &&
      std::getenv("WAYLAND_DISPLAY") == nullptr) {
    SDL_setenv("SDL_VIDEODRIVER", "dummy", /*overwrite=*/0);
  }
  SDL_SetMainReady();
  if (SDL_Init(SDL_INIT_VIDEO) != 0) return sdl_failed("no window here: SDL_Init");
  SDL_SetHint(SDL_HINT_MOUSE_FOCUS_CLICKTHROUGH, "1");
  window_.reset(
      SDL_CreateWindow("throng", SDL_WINDOWPOS_CENTERED, SDL_WINDOWPOS_CENTERED,
                       static_cast<int>(settings_.width_px), static_cast<int>(settings_.height_px),
                       is_hidden_ ? SDL_WINDOW_HIDDEN : SDL_WINDOW_SHOWN | SDL_WINDOW_RESIZABLE));
  if (window_ == nullptr) return sdl_failed("no window here: SDL_CreateWindow");
  // pictures that are compared must not depend on a driver
  if (!is_hidden_) {
    renderer_.reset(SDL_CreateRenderer(window_.get(), -1, SDL_RENDERER_PRESENTVSYNC));
  }
  if (renderer_ == nullptr) {
    renderer_.reset(SDL_CreateRenderer(window_.get(), -1, SDL_RENDERER_SOFTWARE));
  }
  if (renderer_ == nullptr) return sdl_failed("SDL_CreateRenderer");
  IMGUI_CHECKVERSION();
  ImGui::CreateContext();
  library_.has_imgui = true;
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;  // nothing is kept
  set_style();
  const float scale = static_cast<float>(settings_.scale > 0.0 ? settings_.scale
                                         : is_hidden_          ? 1.0
                                                               : scale_of_screen(window_.get()));
  ImGui::GetStyle().ScaleAllSizes(scale);
  std::error_code ignored;
  if (std::filesystem::exists(THRONG_FONT_FILE, ignored)) {
    font_ = io.Fonts->AddFontFromFileTTF(THRONG_FONT_FILE, kFontPx * scale);
  }
  if (font_ == nullptr) font_ = io.Fonts->AddFontDefault();
  library_.has_platform = ImGui_ImplSDL2_InitForSDLRenderer(window_.get());
  if (!library_.has_platform) return sdl_failed("ImGui_ImplSDL2_InitForSDLRenderer");
  if (absl::Status status = gui_.open(renderer_.get()); !status.ok()) return status;
  wake_event_ = SDL_RegisterEvents(1);

  auto link = ViewLink::open(settings_.connection, [event = wake_event_] {
    SDL_Event wake{};
    wake.type = event;
    SDL_PushEvent(&wake);  // full: something wakes the loop anyway
  });
  if (!link.ok()) return link.status();
  link_ = *std::move(link);
  viewer_ = std::make_unique<Viewer>(*link_, settings_.viewer);
  return absl::OkStatus();
}

absl::Status Window::run() {
  absl::Status status = open();
  if (status.ok()) status = loop();
  if (recorder_.is_on()) toggle_recording();
  if (status.ok() && settings_.prints_state) {
    std::printf("%s\n", viewer_->state_json().c_str());
  }
  viewer_.reset();
  link_.reset();  // its threads push events
  return status;
}

absl::Status Window::loop() {
  step_since_s_ = now_s();
  while (!is_done_) {
    SDL_Event event;
    const bool is_busy = flying_since_s_ >= 0.0 || next_step_ < settings_.script.size();
    if (SDL_WaitEventTimeout(&event, is_busy ? 8 : kIdleMs) != 0) {
      do {
        handle(event);
      } while (SDL_PollEvent(&event) != 0);
    }
    const absl::StatusOr<bool> plays = play();
    if (!plays.ok()) return plays.status();
    fly();
    viewer_->update(now_s(), size_px());
    if (panels_.wants_recording) toggle_recording();
    panels_.wants_recording = false;
    record();
    if (absl::Status status = draw(); !status.ok()) return status;
    if (!settings_.script.empty() && !*plays) is_done_ = true;
    if (settings_.script.empty() && !settings_.screenshot.empty()) {
      if (viewer_->is_settled()) {
        screenshot_path_ = settings_.screenshot;
        is_done_ = true;
        if (absl::Status status = draw(); !status.ok()) return status;
      } else if (now_s() - step_since_s_ > settings_.patience_s) {
        return absl::DeadlineExceededError(
            absl::StrCat("no picture within ", settings_.patience_s, " s: ", viewer_->banner()));
      }
    }
  }
  return absl::OkStatus();
}

// ---- what comes from the viewer

void Window::handle(const SDL_Event& event) {
  ImGui_ImplSDL2_ProcessEvent(&event);
  const ImGuiIO& io = ImGui::GetIO();
  switch (event.type) {
    case SDL_QUIT:
      is_done_ = true;
      break;
    case SDL_MOUSEBUTTONDOWN:
      if (io.WantCaptureMouse || is_down_) break;
      is_down_ = true;
      has_moved_ = false;
      button_ = event.button.button;
      pans_ = button_ != SDL_BUTTON_LEFT || is_fast_ || (SDL_GetModState() & KMOD_SHIFT) != 0;
      start_px_ = last_px_ = {event.button.x, event.button.y};
      break;
    case SDL_MOUSEMOTION: {
      if (!is_down_) break;
      const glm::dvec2 at(event.motion.x, event.motion.y);
      if (!has_moved_ && glm::distance(at, start_px_) < kClickPx) break;
      has_moved_ = true;
      viewer_->drag(last_px_, at, pans_);
      last_px_ = at;
      break;
    }
    case SDL_MOUSEBUTTONUP:
      handle_up(event.button);
      break;
    case SDL_MOUSEWHEEL: {
      if (io.WantCaptureMouse) break;
      int x = 0, y = 0;
      SDL_GetMouseState(&x, &y);
      const glm::dvec2 at = settings_.script.empty() ? glm::dvec2(x, y) : pointer_px_;
      const double notches = std::clamp(double{event.wheel.preciseY}, -3.0, 3.0);
      viewer_->zoom_at(std::exp(-notches * kWheelStep), at);
      break;
    }
    case SDL_KEYDOWN:
      is_fast_ = (event.key.keysym.mod & KMOD_SHIFT) != 0;
      if (!io.WantTextInput) handle_key(event.key.keysym, event.key.repeat != 0);
      break;
    case SDL_KEYUP:
      is_fast_ = (event.key.keysym.mod & KMOD_SHIFT) != 0;
      held_.erase(std::remove(held_.begin(), held_.end(), event.key.keysym.sym), held_.end());
      break;
    case SDL_WINDOWEVENT:
      if (event.window.event == SDL_WINDOWEVENT_FOCUS_LOST) held_.clear();
      break;
    default:
      break;
  }
}

void Window::handle_up(const SDL_MouseButtonEvent& event) {
  if (!is_down_ || event.button != button_) return;
  is_down_ = false;
  if (!has_moved_ && !pans_) viewer_->click({event.x, event.y});
}

void Window::handle_key(const SDL_Keysym& key, bool is_repeat) {
  if ((key.mod & (KMOD_CTRL | KMOD_ALT | KMOD_GUI)) != 0) return;
  const bool shift = (key.mod & KMOD_SHIFT) != 0;
  const SDL_Keycode sym = key.sym == SDLK_SLASH && shift ? SDLK_QUESTION : key.sym;
  switch (sym) {
    // held to move
    case SDLK_w:
    case SDLK_a:
    case SDLK_s:
    case SDLK_d:
    case SDLK_q:
    case SDLK_e:
    case SDLK_UP:
    case SDLK_DOWN:
    case SDLK_LEFT:
    case SDLK_RIGHT:
    case SDLK_PLUS:
    case SDLK_EQUALS:
    case SDLK_MINUS:
    case SDLK_KP_PLUS:
    case SDLK_KP_MINUS:
      if (std::find(held_.begin(), held_.end(), sym) == held_.end()) held_.push_back(sym);
      return;
    default:
      break;
  }
  // these may repeat; the rest would flicker
  switch (sym) {
    case SDLK_COMMA:
      return viewer_->step(-1);
    case SDLK_PERIOD:
      return viewer_->step(1);
    default:
      break;
  }
  if (is_repeat) return;
  switch (sym) {
    case SDLK_ESCAPE:
      if (panels_.help) {
        panels_.help = false;
      } else {
        viewer_->stop_following();
      }
      return;
    case SDLK_QUESTION:
    case SDLK_h:
    case SDLK_F1:
      panels_.help = !panels_.help;
      return;
    case SDLK_SPACE:
      return viewer_->toggle_play();
    case SDLK_l:
    case SDLK_END:
      return viewer_->go_live();
    case SDLK_f:
    case SDLK_HOME:
      return viewer_->fit();
    case SDLK_t:
      return viewer_->toggle_top_down();
    case SDLK_LEFTBRACKET:
      return viewer_->faster(-1);
    case SDLK_RIGHTBRACKET:
      return viewer_->faster(1);
    case SDLK_c:
      return viewer_->next_channel();
    case SDLK_i:
      return viewer_->toggle(Overlay::kIds);
    case SDLK_v:
      return viewer_->toggle(Overlay::kTrails);
    case SDLK_m:
      return viewer_->toggle(Overlay::kDensity);
    case SDLK_g:
      return viewer_->toggle(Overlay::kGrid);
    case SDLK_b:
      return viewer_->toggle(Overlay::kScale);
    case SDLK_k:
      return viewer_->toggle(Overlay::kTime);
    case SDLK_o:
      panels_.display = !panels_.display;
      return;
    case SDLK_x:
      panels_.numbers = !panels_.numbers;
      return;
    case SDLK_p:
      panels_.wants_picture = true;
      return;
    case SDLK_r:
      panels_.wants_recording = true;
      return;
    default:
      return;
  }
}

void Window::fly() {
  if (held_.empty()) {
    flying_since_s_ = -1.0;
    return;
  }
  const double now = now_s();
  if (flying_since_s_ < 0.0) {
    flying_since_s_ = now;
    flown_s_ = now - 0.016;
  }
  const auto has = [this](SDL_Keycode key) {
    return std::find(held_.begin(), held_.end(), key) != held_.end() ? 1.0 : 0.0;
  };
  Viewer::Flight flight;
  flight.ahead = has(SDLK_w) - has(SDLK_s);
  flight.right = has(SDLK_d) - has(SDLK_a);
  flight.up = has(SDLK_e) - has(SDLK_q);
  flight.turn = has(SDLK_LEFT) - has(SDLK_RIGHT);
  flight.tilt = has(SDLK_UP) - has(SDLK_DOWN);
  flight.zoom = std::min(1.0, has(SDLK_PLUS) + has(SDLK_EQUALS) + has(SDLK_KP_PLUS)) -
                std::min(1.0, has(SDLK_MINUS) + has(SDLK_KP_MINUS));
  flight.fast = is_fast_;
  viewer_->fly(flight, std::min(0.1, now - flown_s_), now - flying_since_s_);
  flown_s_ = now;
}

// ---- what is drawn

absl::Status Window::upload_picture() {
  const std::shared_ptr<const render::DecodedImage>& image = viewer_->frame()->image;
  if (uploaded_ == image) return absl::OkStatus();
  const int width = static_cast<int>(image->width_px), height = static_cast<int>(image->height_px);
  if (texture_ == nullptr || width != texture_width_ || height != texture_height_) {
    texture_.reset(SDL_CreateTexture(renderer_.get(), SDL_PIXELFORMAT_RGBA32,
                                     SDL_TEXTUREACCESS_STREAMING, width, height));
    if (texture_ == nullptr) return sdl_failed("SDL_CreateTexture");
    texture_width_ = width;
    texture_height_ = height;
    SDL_SetTextureBlendMode(texture_.get(), SDL_BLENDMODE_NONE);
    SDL_SetTextureScaleMode(texture_.get(), SDL_ScaleModeLinear);
  }
  if (SDL_UpdateTexture(texture_.get(), nullptr, image->rgbx.data(), 4 * width) != 0) {
    return sdl_failed("SDL_UpdateTexture");
  }
  uploaded_ = image;
  return absl::OkStatus();
}

absl::Status Window::draw() {
  ImGui_ImplSDL2_NewFrame();
  if (!settings_.script.empty()) push_pointer();
  ImGui::NewFrame();
  const glm::dvec2 window_px = size_px();
  const bool is_picture = panels_.wants_picture;  // of the crowd, without panels
  Insets insets = panel_insets();
  if (is_picture) insets = {12, 12, 12, 12};
  draw_overlays(*viewer_, window_px, insets, font_, *ImGui::GetBackgroundDrawList());
  if (!is_picture) draw_panels(*viewer_, panels_);
  ImGui::Render();

  SDL_SetRenderDrawColor(renderer_.get(), 16, 22, 31, 255);
  SDL_RenderClear(renderer_.get());
  if (viewer_->frame() != nullptr) {
    if (absl::Status status = upload_picture(); !status.ok()) return status;
    const Viewer::Placement at = viewer_->placement();
    const SDL_FRect place{static_cast<float>(at.corner_px.x), static_cast<float>(at.corner_px.y),
                          static_cast<float>(at.size_px.x), static_cast<float>(at.size_px.y)};
    SDL_RenderCopyF(renderer_.get(), texture_.get(), nullptr, &place);
  }
  gui_.draw(*ImGui::GetDrawData());
  if (is_picture) {
    panels_.wants_picture = false;
    if (absl::Status status = save_picture(); !status.ok()) {
      viewer_->toast(std::string(status.message()));
    }
  }
  if (!screenshot_path_.empty()) {
    if (absl::Status status = save(screenshot_path_); !status.ok()) return status;
    screenshot_path_.clear();
  }
  SDL_RenderPresent(renderer_.get());
  return absl::OkStatus();
}

absl::Status Window::save(const std::string& path) {
  int width = 0, height = 0;
  SDL_GetRendererOutputSize(renderer_.get(), &width, &height);
  std::vector<std::uint8_t> rgbx(std::size_t{4} * static_cast<std::size_t>(width) *
                                 static_cast<std::size_t>(height));
  if (SDL_RenderReadPixels(renderer_.get(), nullptr, SDL_PIXELFORMAT_RGBA32, rgbx.data(),
                           4 * width) != 0) {
    return sdl_failed("SDL_RenderReadPixels");
  }
  const auto png = render::encode_png(rgbx, static_cast<std::uint32_t>(width),
                                      static_cast<std::uint32_t>(height));
  if (!png.ok()) return png.status();
  return render::write_file(path, *png);
}

std::string Window::path_with(const char* ending) const {
  std::string name = absl::StrCat(viewer_->crowd(), "-",
                                  format_time(viewer_->frame()->message.scene_time_us()), ending);
  for (char& c : name) {
    if (c == '/' || c == ':' || c == '\0') c = '.';
  }
  return (std::filesystem::path(settings_.pictures) / name).string();
}

absl::Status Window::save_picture() {
  if (viewer_->frame() == nullptr) return absl::UnavailableError("There is no picture yet");
  const std::string path = path_with(".png");
  if (absl::Status status = save(path); !status.ok()) return status;
  viewer_->toast(absl::StrCat("Saved ", path));
  return absl::OkStatus();
}

void Window::toggle_recording() {
  if (recorder_.is_on()) {
    const absl::StatusOr<std::string> saved = recorder_.stop();
    viewer_->toast(saved.ok() ? *saved : std::string(saved.status().message()));
  } else if (viewer_->frame() != nullptr) {
    const absl::Status status =
        recorder_.start(path_with(".mp4"), *viewer_->frame()->image, now_s());
    if (!status.ok()) viewer_->toast(std::string(status.message()));
  }
}

void Window::record() {
  panels_.recording = recorder_.is_on();
  if (!recorder_.is_on() || viewer_->frame() == nullptr) return;
  const absl::Status status = recorder_.add(viewer_->frame()->image, now_s());
  if (status.ok()) return;
  toggle_recording();  // what there is stays
  if (!absl::IsFailedPrecondition(status)) viewer_->toast(std::string(status.message()));
}

// ---- the script

void Window::push_pointer() {
  // the backend asks the system, which knows of no pointer
  ImGuiIO& io = ImGui::GetIO();
  io.MousePos = {static_cast<float>(pointer_px_.x), static_cast<float>(pointer_px_.y)};
  io.MouseDown[0] = pointer_down_[0];
  io.MouseDown[1] = pointer_down_[1];
}

/// One step. False: there is none left.
absl::StatusOr<bool> Window::play() {
  if (next_step_ >= settings_.script.size()) return false;
  const ScriptStep& step = settings_.script[next_step_];
  SDL_Event event{};
  const std::uint32_t window = SDL_GetWindowID(window_.get());
  switch (step.kind) {
    case ScriptStep::Kind::kMove:
      pointer_px_ = {step.x, step.y};
      event.type = SDL_MOUSEMOTION;
      event.motion.windowID = window;
      event.motion.x = static_cast<int>(step.x);
      event.motion.y = static_cast<int>(step.y);
      handle(event);
      break;
    case ScriptStep::Kind::kDown:
    case ScriptStep::Kind::kUp: {
      const bool down = step.kind == ScriptStep::Kind::kDown;
      pointer_down_[step.button == 1 ? 0 : 1] = down;
      event.type = down ? SDL_MOUSEBUTTONDOWN : SDL_MOUSEBUTTONUP;
      event.button.windowID = window;
      event.button.button = static_cast<std::uint8_t>(step.button);
      event.button.x = static_cast<int>(step.x);
      event.button.y = static_cast<int>(step.y);
      handle(event);
      break;
    }
    case ScriptStep::Kind::kWheel:
      event.type = SDL_MOUSEWHEEL;
      event.wheel.windowID = window;
      event.wheel.y = static_cast<int>(step.x);
      event.wheel.preciseY = static_cast<float>(step.x);
      handle(event);
      break;
    case ScriptStep::Kind::kKeyDown:
    case ScriptStep::Kind::kKeyUp: {
      const SDL_Keycode sym = SDL_GetKeyFromName(step.text.c_str());
      if (sym == SDLK_UNKNOWN) {
        return absl::InvalidArgumentError(
            absl::StrCat("script: '", step.text, "' is no name of a key, such as T, Space, Left"));
      }
      event.type = step.kind == ScriptStep::Kind::kKeyDown ? SDL_KEYDOWN : SDL_KEYUP;
      event.key.windowID = window;
      event.key.keysym.sym = sym;
      event.key.keysym.scancode = SDL_GetScancodeFromKey(sym);
      event.key.keysym.mod = step.shift ? KMOD_LSHIFT : KMOD_NONE;
      handle(event);
      break;
    }
    case ScriptStep::Kind::kSize:
      SDL_SetWindowSize(window_.get(), static_cast<int>(step.x), static_cast<int>(step.y));
      break;
    case ScriptStep::Kind::kWait: {
      const absl::StatusOr<bool> held = holds(step.text, viewer_->state_json());
      if (!held.ok()) return held.status();
      if (*held) break;
      if (now_s() - step_since_s_ > settings_.patience_s) {
        return absl::DeadlineExceededError(absl::StrCat("script: wait ", step.text, ": not within ",
                                                        settings_.patience_s, " s; ",
                                                        viewer_->state_json()));
      }
      return true;
    }
    case ScriptStep::Kind::kScreenshot:
      screenshot_path_ = step.text;
      break;
    case ScriptStep::Kind::kState: {
      std::ofstream file(step.text, std::ios::app | std::ios::binary);
      file << viewer_->state_json() << "\n";
      if (!file.flush()) {
        return absl::UnavailableError(absl::StrCat(step.text, ": can't be written"));
      }
      break;
    }
  }
  ++next_step_;
  step_since_s_ = now_s();
  return true;
}

}  // namespace

absl::Status run_window(const WindowSettings& settings) { return Window(settings).run(); }

}  // namespace throng::client
