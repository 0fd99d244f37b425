#include "simplify/report/sheet.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "simplify/report/canvas.hpp"
#include "simplify/report/report.hpp"
#include "simplify/report/studio.hpp"
#include "throng/render/encode.hpp"

namespace throng::simplify {
namespace {

constexpr float kElevationRad = 0.16F, kTurnRad = 0.42F;
constexpr int kRowWidthPx = 1900, kRulerPx = 70, kMarginPx = 26, kGapPx = 26, kTitlePx = 64;
constexpr int kHeadRoomPx = 34, kFloorPx = 40, kNamePx = 54;
constexpr float kLikeHeights = 2.4F;  // tallest to shortest of a row
constexpr float kNameCapPx = 10.5F, kSmallCapPx = 8.5F;
const glm::u8vec3 kPaper(244, 243, 240), kWall(226, 225, 222), kFloor(206, 204, 199);
const glm::u8vec3 kLine(208, 207, 203), kInk(40, 40, 42), kPale(118, 117, 113);

struct Guest {
  std::string name;
  render::Character character;
  PosedVertices posed;
  Frame frame;  // metres
  std::vector<std::string> name_lines;
};
struct Row {
  std::vector<const Guest*> guests;
  float px_per_m = 1.0F;
  int width = 0;
};

PoseId standing_pose(const render::Character& character) {
  for (const render::ClipKind kind : {render::ClipKind::kIdle, render::ClipKind::kWalk}) {
    for (std::uint32_t c = 0; c < character.clips.size(); ++c) {
      if (character.clips[c].kind == kind) return {c, 0};
    }
  }
  return {0, 0};
}

/// Breaks a long name after '_' or '-'.
std::vector<std::string> lines_of(const std::string& name) {
  constexpr float kWidestPx = 150.0F;
  std::vector<std::string> lines(1);
  std::string word;
  for (std::size_t i = 0; i <= name.size(); ++i) {
    if (i < name.size()) word += name[i];
    if (i < name.size() && name[i] != '_' && name[i] != '-') continue;
    if (!lines.back().empty() && Canvas::width_of(lines.back() + word, kNameCapPx) > kWidestPx)
      lines.emplace_back();
    lines.back() += word;
    word.clear();
  }
  return lines;
}

int width_px(const Guest& guest, float px_per_m) {
  float width = (guest.frame.high.x - guest.frame.low.x) * px_per_m;
  for (const std::string& line : guest.name_lines)
    width = std::max(width, Canvas::width_of(line, kNameCapPx));
  return static_cast<int>(std::ceil(width));
}

/// @param guests  the tallest first
std::vector<Row> rows_of(const std::vector<Guest>& guests, float figure_px, int widest_px) {
  std::vector<Row> rows;
  for (const Guest& guest : guests) {
    const bool fits =
        !rows.empty() &&
        guest.character.height_m * kLikeHeights >= rows.back().guests[0]->character.height_m &&
        rows.back().width + kGapPx + width_px(guest, rows.back().px_per_m) <= widest_px;
    if (!fits) rows.push_back({{}, figure_px / guest.character.height_m, 0});
    Row& row = rows.back();
    row.width += width_px(guest, row.px_per_m) + (row.guests.empty() ? 0 : kGapPx);
    row.guests.push_back(&guest);
  }
  return rows;
}

/// 1, 2 or 5 times a power of ten, so that lines are some 60 px apart.
float line_step_m(float px_per_m) {
  const float wanted = 60.0F / px_per_m;
  const float power = std::pow(10.0F, std::floor(std::log10(wanted)));
  for (const float factor : {1.0F, 2.0F, 5.0F}) {
    if (power * factor >= wanted) return power * factor;
  }
  return 10.0F * power;
}

/// Darkens the floor below what is near it.
void add_shadow(const Guest& guest, const glm::vec2& origin, float px_per_m, Canvas& canvas) {
  const float height = guest.character.height_m;
  const float c = std::cos(kTurnRad - 1.5707963F), s = std::sin(kTurnRad - 1.5707963F);
  const float reach = 0.075F * height * px_per_m, flat = std::sin(kElevationRad);
  std::vector<float> dark(std::size_t{canvas.width_px()} * canvas.height_px());
  for (const glm::vec3& p : guest.posed.position) {
    const float strength = 0.42F * std::exp(-std::max(p.z, 0.0F) / (0.10F * height));
    if (strength < 0.02F) continue;
    const glm::vec2 at =
        origin + px_per_m * glm::vec2(c * p.x - s * p.y, -flat * (s * p.x + c * p.y));
    const glm::ivec2 low(glm::floor(at - glm::vec2(reach, reach * flat)));
    const glm::ivec2 high(glm::ceil(at + glm::vec2(reach, reach * flat)));
    for (int y = std::max(low.y, 0);
         y <= std::min(high.y, static_cast<int>(canvas.height_px()) - 1); ++y) {
      for (int x = std::max(low.x, 0);
           x <= std::min(high.x, static_cast<int>(canvas.width_px()) - 1); ++x) {
        const glm::vec2 d = (glm::vec2(x, y) + 0.5F - at) / glm::vec2(reach, reach * flat);
        const float near = std::max(1.0F - glm::dot(d, d), 0.0F);
        float& value =
            dark[static_cast<std::size_t>(y) * canvas.width_px() + static_cast<std::size_t>(x)];
        value = std::max(value, strength * near * near);
      }
    }
  }
  for (std::size_t i = 0; i < dark.size(); ++i) {
    if (dark[i] > 0.0F)
      canvas.mix(static_cast<int>(i % canvas.width_px()), static_cast<int>(i / canvas.width_px()),
                 glm::vec3(52.0F, 50.0F, 48.0F), dark[i]);
  }
}

absl::Status add_figure(const Guest& guest, const glm::vec2& origin, float px_per_m,
                        Canvas& canvas) {
  auto studio = Studio::make(guest.character, seed_of(guest.name));
  if (!studio.ok()) return studio.status();
  const glm::ivec2 low(glm::floor(origin + guest.frame.low * px_per_m) - 2.0F);
  const glm::ivec2 high(glm::ceil(origin + guest.frame.high * px_per_m) + 2.0F);
  const glm::ivec2 size = high - low;
  const Figure figure{&guest.posed, kTurnRad, 2.0F * (origin - glm::vec2(low))};
  const Shot shot{kElevationRad, 2.0F * px_per_m, static_cast<std::uint32_t>(2 * size.x),
                  static_cast<std::uint32_t>(2 * size.y)};
  const LevelMesh mesh = level_mesh(guest.character, guest.character.vertex_count());
  const auto cutout = (*studio)->cut_out(mesh, figure, shot);
  if (!cutout.ok()) return cutout.status();
  canvas.lay(*cutout, low.x, low.y);
  return absl::OkStatus();
}

absl::Status paint_row(const Row& row, int top, Canvas& canvas) {
  const auto width = static_cast<int>(canvas.width_px());
  float highest_m = row.guests[0]->character.height_m;
  for (const Guest* guest : row.guests) highest_m = std::max(highest_m, -guest->frame.low.y);
  const int ground = top + kHeadRoomPx + static_cast<int>(highest_m * row.px_per_m);
  canvas.fill(kMarginPx, top, width - 2 * kMarginPx, ground - 14 - top, kWall);
  // the wall fades into the floor
  for (int y = ground - 14; y < ground + kFloorPx; ++y) {
    const float share = glm::smoothstep(0.0F, 1.0F, static_cast<float>(y - ground + 14) / 22.0F);
    canvas.fill(kMarginPx, y, width - 2 * kMarginPx, 1,
                glm::u8vec3(glm::mix(glm::vec3(kWall), glm::vec3(kFloor), share) + 0.5F));
  }
  const float step_m = line_step_m(row.px_per_m);
  for (int i = 0;
       static_cast<float>(i) * step_m * row.px_per_m < static_cast<float>(ground - top - 10); ++i) {
    const float y = static_cast<float>(ground) - static_cast<float>(i) * step_m * row.px_per_m;
    const auto left = static_cast<float>(kMarginPx + kRulerPx - 14);
    if (i > 0)
      canvas.stroke({left, y}, {static_cast<float>(width - kMarginPx - 12), y}, 1.0F, kLine);
    const std::string words =
        absl::StrFormat("%g m", std::round(static_cast<float>(i) * step_m * 1000.0F) / 1000.0F);
    canvas.write(words,
                 {left - 8.0F - Canvas::width_of(words, kSmallCapPx), y + 0.5F * kSmallCapPx},
                 kSmallCapPx, kPale);
  }
  float x = 0.5F * static_cast<float>(width + kRulerPx - row.width);
  for (const Guest* each : row.guests) {
    const Guest& guest = *each;
    const auto place = static_cast<float>(width_px(guest, row.px_per_m));
    const glm::vec2 origin(
        x + 0.5F * place - 0.5F * (guest.frame.low.x + guest.frame.high.x) * row.px_per_m,
        static_cast<float>(ground));
    add_shadow(guest, origin, row.px_per_m, canvas);
    if (auto status = add_figure(guest, origin, row.px_per_m, canvas); !status.ok()) return status;
    float y = static_cast<float>(ground + kFloorPx) + 20.0F;
    for (const std::string& line : guest.name_lines) {
      canvas.write(line, {x + 0.5F * (place - Canvas::width_of(line, kNameCapPx)), y}, kNameCapPx,
                   kInk);
      y += 16.0F;
    }
    const std::string height = absl::StrFormat("%.2f m", guest.character.height_m);
    canvas.write(height, {x + 0.5F * (place - Canvas::width_of(height, kSmallCapPx)), y},
                 kSmallCapPx, kPale);
    x += place + kGapPx;
  }
  return absl::OkStatus();
}

int height_of(const Row& row) {
  float highest_m = row.guests[0]->character.height_m;
  std::size_t lines = 1;
  for (const Guest* guest : row.guests) {
    highest_m = std::max(highest_m, -guest->frame.low.y);
    lines = std::max(lines, guest->name_lines.size());
  }
  return kHeadRoomPx + static_cast<int>(highest_m * row.px_per_m) + kFloorPx + kNamePx +
         16 * (static_cast<int>(lines) - 1);
}

}  // namespace

absl::Status write_sheet(const SheetOptions& options) {
  const auto files = find_baked(options.inputs, options.characters);
  if (!files.ok()) return files.status();
  std::vector<Guest> guests;
  for (const BakedFile& file : *files) {
    auto character = render::read_character(file.path);
    if (!character.ok()) return character.status();
    Guest guest{file.name, *std::move(character), {}, {}, lines_of(file.name)};
    guest.posed = pose_vertices(guest.character, standing_pose(guest.character));
    guest.frame = frame_of(guest.posed, kTurnRad, kElevationRad);
    guests.push_back(std::move(guest));
  }
  std::stable_sort(guests.begin(), guests.end(), [](const Guest& a, const Guest& b) {
    return a.character.height_m != b.character.height_m
               ? a.character.height_m > b.character.height_m
               : a.name < b.name;
  });
  const auto figure_px = static_cast<float>(options.figure_px);
  std::vector<Row> rows = rows_of(guests, figure_px, kRowWidthPx);
  // the narrowest rows that aren't more
  const std::size_t count = rows.size();
  for (int widest = kRowWidthPx - 40; widest > 200; widest -= 40) {
    std::vector<Row> narrower = rows_of(guests, figure_px, widest);
    if (narrower.size() > count) break;
    rows = std::move(narrower);
  }
  int width = 500, height = kTitlePx + kMarginPx;
  for (const Row& row : rows) {
    width = std::max(width, row.width + kRulerPx + 2 * kMarginPx + 2 * kGapPx);
    height += height_of(row);
  }
  Canvas canvas(static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height), kPaper);
  canvas.write(guests.size() == 1 ? guests[0].name : absl::StrCat(guests.size(), " characters"),
               {static_cast<float>(kMarginPx), 42.0F}, 17.0F, kInk);
  int top = kTitlePx;
  for (const Row& row : rows) {
    if (auto status = paint_row(row, top, canvas); !status.ok()) return status;
    top += height_of(row);
  }
  const render::Picture& picture = canvas.picture();
  const auto png = render::encode_png(picture.rgbx, picture.width_px, picture.height_px);
  if (!png.ok()) return png.status();
  return render::write_file(options.path, *png);
}

}  // namespace throng::simplify
