#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "simplify/import/document.hpp"

namespace throng::simplify::gltf {

/// EXT_meshopt_compression's description of one buffer view.
struct MeshoptPart {
  std::uint64_t count = 0;
  std::uint64_t stride = 0;
  std::string mode;    // ATTRIBUTES, TRIANGLES, INDICES
  std::string filter;  // NONE, OCTAHEDRAL, QUATERNION, EXPONENTIAL
};

/// The view's plain bytes, count * stride of them. InvalidArgument when the data are damaged, or
/// when throng was built without meshoptimizer.
absl::StatusOr<Bytes> decode_meshopt(std::span<const std::uint8_t> data, const MeshoptPart& part);

/// A mesh out of KHR_draco_mesh_compression. Integer attributes are kept as numbers, normalised
/// ones are divided by their largest value.
struct DracoMesh {
  struct Attribute {
    std::uint32_t components = 0;
    std::vector<float> values;  // [vertices][components]
  };
  std::uint32_t vertex_count = 0;
  std::vector<std::uint32_t> indices;           // three a triangle
  std::map<std::string, Attribute> attributes;  // by glTF name
};

/// InvalidArgument when the data are damaged, or when throng was built without Draco.
absl::StatusOr<DracoMesh> decode_draco(std::span<const std::uint8_t> data, const DracoPart& part);

}  // namespace throng::simplify::gltf
