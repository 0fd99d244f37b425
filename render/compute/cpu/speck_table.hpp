#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "render/compute/cpu/cast_table.hpp"
#include "render/compute/cpu/stages.hpp"
#include "render/compute/element/speck.hpp"
#include "render/compute/element/speck_slab.hpp"

namespace throng::render {

/// Pictures of the cast in a few slabs each, made from its surface points: what a figure of a few
/// pixels looks like once it is averaged over them.
struct SpeckTable : SpeckLevels {
  std::shared_ptr<const CastTable> cast;
  std::vector<std::uint8_t> has_images;  // by character: who was baked without points has none
  std::vector<SpeckImage> image;         // [characters * element::kSpeckImages]
  std::vector<SpeckSlab> slab;           // [kSlabs] for each
};

/// Poses 1,024 points of each character in each of its poses and looks at them from all sides, a
/// pose by a thread: longer than a frame, and once for a cast.
/// @param before  null, or a table whose pictures hold where only the surroundings are others
std::shared_ptr<const SpeckTable> make_speck_table(const std::shared_ptr<const CastTable>& cast,
                                                   Machine machine,
                                                   std::vector<WorkerScratch>& scratch,
                                                   const SpeckTable* before = nullptr);

}  // namespace throng::render
