#include "client/desktop/gui_renderer.hpp"

#include <SDL.h>
#include <absl/strings/str_cat.h>
#include <imgui.h>

#include <cmath>

namespace throng::client {

// a vertex's colour is taken as it lies in memory
static_assert(sizeof(SDL_Color) == sizeof(ImU32) && IM_COL32_R_SHIFT == 0);

GuiRenderer::~GuiRenderer() {
  if (font_ != nullptr) SDL_DestroyTexture(font_);
}

absl::Status GuiRenderer::open(SDL_Renderer* renderer) {
  renderer_ = renderer;
  ImGuiIO& io = ImGui::GetIO();
  unsigned char* pixels = nullptr;
  int width = 0, height = 0;
  io.Fonts->GetTexDataAsRGBA32(&pixels, &width, &height);
  font_ =
      SDL_CreateTexture(renderer, SDL_PIXELFORMAT_RGBA32, SDL_TEXTUREACCESS_STATIC, width, height);
  if (font_ == nullptr || SDL_UpdateTexture(font_, nullptr, pixels, 4 * width) != 0) {
    return absl::UnavailableError(absl::StrCat("the fonts' texture: ", SDL_GetError()));
  }
  SDL_SetTextureBlendMode(font_, SDL_BLENDMODE_BLEND);
  SDL_SetTextureScaleMode(font_, SDL_ScaleModeLinear);
  io.Fonts->SetTexID(font_);
  io.BackendFlags |= ImGuiBackendFlags_RendererHasVtxOffset;
  return absl::OkStatus();
}

void GuiRenderer::draw(const ImDrawData& data) {
  for (int i = 0; i < data.CmdListsCount; ++i) {
    const ImDrawList& list = *data.CmdLists[i];
    for (const ImDrawCmd& command : list.CmdBuffer) {
      const ImVec4& clip = command.ClipRect;
      const SDL_Rect rectangle{static_cast<int>(clip.x), static_cast<int>(clip.y),
                               static_cast<int>(std::ceil(clip.z) - std::floor(clip.x)),
                               static_cast<int>(std::ceil(clip.w) - std::floor(clip.y))};
      if (rectangle.w <= 0 || rectangle.h <= 0) continue;
      SDL_RenderSetClipRect(renderer_, &rectangle);
      const ImDrawVert* const first = list.VtxBuffer.Data + command.VtxOffset;
      constexpr int kStride = sizeof(ImDrawVert);
      SDL_RenderGeometryRaw(renderer_, static_cast<SDL_Texture*>(command.GetTexID()), &first->pos.x,
                            kStride, reinterpret_cast<const SDL_Color*>(&first->col), kStride,
                            &first->uv.x, kStride,
                            list.VtxBuffer.Size - static_cast<int>(command.VtxOffset),
                            list.IdxBuffer.Data + command.IdxOffset,
                            static_cast<int>(command.ElemCount), sizeof(ImDrawIdx));
    }
  }
  SDL_RenderSetClipRect(renderer_, nullptr);
}

}  // namespace throng::client
