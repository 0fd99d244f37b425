#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>

#include "render/raster/visibility/cuda/raster_types.hpp"

// Every launch is asynchronous on `stream` and returns what the runtime said of it.
namespace throng::render::visibility::cuda {

/// What shading needs of every instance, and how many triangle blocks it has.
cudaError_t launch_prepare(const RasterJob& job, cudaStream_t stream);

/// Who casts a projected shadow, the shadows of those and of all others. After launch_prepare.
cudaError_t launch_shadows(const RasterJob& job, cudaStream_t stream);

/// All triangles into `words`. `first_block` is known.
cudaError_t launch_raster(const RasterJob& job, std::uint32_t most_blocks, cudaStream_t stream);

/// Figures that share a pose into `words`, after launch_raster.
cudaError_t launch_shared(const RasterJob& job, cudaStream_t stream);

/// Points and impostors into `words`, after launch_raster.
cudaError_t launch_forms(const RasterJob& job, cudaStream_t stream);

/// Triangles that raster and shadows left to whole tiles.
cudaError_t launch_large(const RasterJob& job, cudaStream_t stream);

/// Specks to where they are on the picture, and how many entries all tiles' lists have:
/// first_entry[S].
cudaError_t launch_place_specks(const RasterJob& job, void* scratch, std::size_t scratch_bytes,
                                cudaStream_t stream);

/// Bytes of scratch memory that sorting so many entries wants.
cudaError_t speck_scratch_bytes(std::uint32_t entries, std::size_t& bytes);

/// Specks near to far over what `words` show, before launch_resolve.
cudaError_t launch_specks(const RasterJob& job, void* scratch, std::size_t scratch_bytes,
                          cudaStream_t stream);

/// Words and shadows to `pixels`.
cudaError_t launch_resolve(const RasterJob& job, cudaStream_t stream);

/// Words to `fact_depth`, `fact_instance` and `fact_bounds`, where they are asked for.
cudaError_t launch_facts(const RasterJob& job, cudaStream_t stream);

/// Pixels r g b x to r g b, four at a time: 4 * groups of them are read.
cudaError_t launch_pack(const std::uint32_t* rgbx, std::uint32_t* rgb, std::uint32_t groups,
                        cudaStream_t stream);

}  // namespace throng::render::visibility::cuda
