#include "render/raster/smooth_edges.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>

#include "render/compute/cpu/work_pool.hpp"

namespace throng::render {
namespace {

constexpr std::size_t kRowsPerChunk = 16;
constexpr int kSearchPx = 12;  // an edge is followed this far each way

/// A picture's brightness; reads beyond the border give the border.
struct Brightness {
  const std::uint8_t* values;
  int width, height;
  int operator()(int x, int y) const {
    x = std::clamp(x, 0, width - 1);
    y = std::clamp(y, 0, height - 1);
    return values[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)];
  }
};

void brighten(const std::uint8_t* rgbx, std::uint8_t* brightness, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    // weights of Rec. 601 in parts of 32
    brightness[i] = static_cast<std::uint8_t>(
        (10 * rgbx[4 * i] + 18 * rgbx[4 * i + 1] + 4 * rgbx[4 * i + 2]) >> 5);
  }
}

/// mask[x] is not 0 where pixel x of the row may lie at an edge. Rows are padded by the caller.
void find_edges(const std::uint8_t* above, const std::uint8_t* row, const std::uint8_t* below,
                int width, std::uint8_t* mask) {
  mask[0] = mask[width - 1] = 1;
  for (int x = 1; x + 1 < width; ++x) {
    const std::uint8_t high =
        std::max(std::max(std::max(above[x], below[x]), std::max(row[x - 1], row[x + 1])), row[x]);
    const std::uint8_t low =
        std::min(std::min(std::min(above[x], below[x]), std::min(row[x - 1], row[x + 1])), row[x]);
    mask[x] = static_cast<std::uint8_t>(high - low) > 12 ? 1 : 0;
  }
}

/// How far towards the neighbour across the edge the pixel moves, 0 to 1, and which neighbour.
struct Shift {
  float share;
  int dx, dy;
};

Shift shift_of(const Brightness& at, int x, int y) {
  const int m = at(x, y), n = at(x, y - 1), s = at(x, y + 1), w = at(x - 1, y), e = at(x + 1, y);
  const int high = std::max({m, n, s, w, e}), low = std::min({m, n, s, w, e});
  const int contrast = high - low;
  if (contrast <= std::max(12, high / 8)) return {0.0F, 0, 0};
  const int nw = at(x - 1, y - 1), ne = at(x + 1, y - 1), sw = at(x - 1, y + 1),
            se = at(x + 1, y + 1);
  const int across_y =
      std::abs(nw + sw - 2 * w) + 2 * std::abs(n + s - 2 * m) + std::abs(ne + se - 2 * e);
  const int across_x =
      std::abs(nw + ne - 2 * n) + 2 * std::abs(w + e - 2 * m) + std::abs(sw + se - 2 * s);
  const bool level = across_y >= across_x;  // the edge runs along x
  const int before = level ? n : w, after = level ? s : e;
  const int sign = std::abs(before - m) >= std::abs(after - m) ? -1 : 1;
  const int beyond = sign < 0 ? before : after;

  // Twice the edge's brightness; the edge ends where the pair's mean has left it by a quarter step.
  const int edge2 = beyond + m, limit4 = std::abs(beyond - m);
  const int ax = level ? 1 : 0, ay = level ? 0 : 1;
  const int nx = level ? 0 : sign, ny = level ? sign : 0;
  int reach[2] = {kSearchPx, kSearchPx}, end2[2] = {0, 0};
  for (int side = 0; side < 2; ++side) {
    const int direction = side == 0 ? -1 : 1;
    for (int i = 1; i <= kSearchPx; ++i) {
      const int px = x + direction * i * ax, py = y + direction * i * ay;
      end2[side] = at(px, py) + at(px + nx, py + ny) - edge2;
      if (2 * std::abs(end2[side]) >= limit4) {
        reach[side] = i;
        break;
      }
    }
  }
  const int nearest = std::min(reach[0], reach[1]);
  const int end = reach[0] < reach[1] ? end2[0] : end2[1];
  // Only where the run ends on the other side of the edge's brightness does it cut this pixel.
  float share = 0.0F;
  if ((end < 0) != (2 * m - edge2 < 0) && nearest < kSearchPx) {
    share =
        0.5F - (static_cast<float>(nearest) - 0.5F) / static_cast<float>(reach[0] + reach[1] - 1);
    share = std::max(share, 0.0F);
  }
  // Single pixels and thin lines have no run to follow: they lean towards their neighbours' mean.
  const float mean = static_cast<float>(2 * (n + s + w + e) + nw + ne + sw + se) / 12.0F;
  // (at a straight edge the mean is a third away, which must not blur it)
  const float away = std::abs(mean - static_cast<float>(m)) / static_cast<float>(contrast);
  const float lone = std::clamp(1.5F * away - 0.5F, 0.0F, 1.0F);
  const float smooth = lone * lone * (3.0F - 2.0F * lone);
  share = std::max(share, smooth * smooth * 0.6F);
  return {share, nx, ny};
}

}  // namespace

void smooth_edges(Picture& picture, SmoothScratch& scratch, WorkPool& pool) {
  const int width = static_cast<int>(picture.width_px),
            height = static_cast<int>(picture.height_px);
  if (width < 3 || height < 3) return;
  const auto row_px = static_cast<std::size_t>(width);
  const std::size_t rows = static_cast<std::size_t>(height);
  scratch.brightness.resize(row_px * rows);
  const std::size_t chunk_count = (rows + kRowsPerChunk - 1) / kRowsPerChunk;
  scratch.changes.resize(std::max(scratch.changes.size(), chunk_count));

  std::uint8_t* pixels = picture.rgbx.data();
  pool.for_chunks(rows, kRowsPerChunk, [&](std::size_t begin, std::size_t end) {
    brighten(pixels + 4 * begin * row_px, scratch.brightness.data() + begin * row_px,
             (end - begin) * row_px);
  });

  // Find first, write afterwards: neighbours must see the picture as it was.
  const Brightness at{scratch.brightness.data(), width, height};
  pool.run(chunk_count, [&](std::size_t chunk, unsigned) {
    std::vector<SmoothScratch::Change>& changes = scratch.changes[chunk];
    changes.clear();
    std::vector<std::uint8_t> mask(row_px + 8, 0);
    const std::size_t end = std::min(rows, (chunk + 1) * kRowsPerChunk);
    for (std::size_t y = chunk * kRowsPerChunk; y < end; ++y) {
      const std::uint8_t* row = scratch.brightness.data() + y * row_px;
      find_edges(y > 0 ? row - row_px : row, row, y + 1 < rows ? row + row_px : row, width,
                 mask.data());
      for (std::size_t block = 0; block < row_px; block += 8) {
        std::uint64_t any = 0;
        std::memcpy(&any, mask.data() + block, 8);
        if (any == 0) continue;
        for (std::size_t x = block; x < std::min(block + 8, row_px); ++x) {
          if (mask[x] == 0) continue;
          const Shift shift = shift_of(at, static_cast<int>(x), static_cast<int>(y));
          const int share = static_cast<int>(shift.share * 256.0F + 0.5F);
          if (share == 0) continue;
          const int ox = std::clamp(static_cast<int>(x) + shift.dx, 0, width - 1);
          const int oy = std::clamp(static_cast<int>(y) + shift.dy, 0, height - 1);
          const std::uint8_t* a = pixels + 4 * (y * row_px + x);
          const std::uint8_t* b =
              pixels + 4 * (static_cast<std::size_t>(oy) * row_px + static_cast<std::size_t>(ox));
          std::uint8_t mixed[4];
          for (int i = 0; i < 4; ++i)
            mixed[i] = static_cast<std::uint8_t>((a[i] * (256 - share) + b[i] * share + 128) >> 8);
          SmoothScratch::Change change{static_cast<std::uint32_t>(y * row_px + x), 0};
          std::memcpy(&change.rgbx, mixed, 4);
          changes.push_back(change);
        }
      }
    }
  });
  pool.run(chunk_count, [&](std::size_t chunk, unsigned) {
    for (const SmoothScratch::Change& change : scratch.changes[chunk]) {
      std::memcpy(pixels + std::size_t{4} * change.pixel, &change.rgbx, 4);
    }
  });
}

}  // namespace throng::render
