#pragma once

#include <absl/status/status.h>

struct ImDrawData;
struct SDL_Renderer;
struct SDL_Texture;

namespace throng::client {

/// Draws Dear ImGui's triangles with SDL's own renderer, which needs no GPU. (Debian's Dear ImGui
/// comes with the window's side for SDL but without this one.)
class GuiRenderer {
 public:
  GuiRenderer() = default;
  ~GuiRenderer();
  GuiRenderer(const GuiRenderer&) = delete;
  GuiRenderer& operator=(const GuiRenderer&) = delete;

  /// Once the fonts are chosen. Unavailable with what SDL said.
  absl::Status open(SDL_Renderer* renderer);
  void draw(const ImDrawData& data);

 private:
  SDL_Renderer* renderer_ = nullptr;
  SDL_Texture* font_ = nullptr;
};

}  // namespace throng::client
