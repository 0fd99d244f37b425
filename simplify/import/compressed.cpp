#include "simplify/import/compressed.hpp"

#include <absl/strings/str_cat.h>

#include "simplify/import/limits.hpp"

#ifdef THRONG_WITH_MESHOPT
#include <meshoptimizer.h>
#endif
#ifdef THRONG_WITH_DRACO
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wall"
#pragma GCC diagnostic ignored "-Wextra"
#include <draco/compression/decode.h>
#pragma GCC diagnostic pop
#endif

namespace throng::simplify::gltf {

#ifdef THRONG_WITH_MESHOPT

absl::StatusOr<Bytes> decode_meshopt(std::span<const std::uint8_t> data, const MeshoptPart& part) {
  // the library asserts what the extension's text demands, so it is checked here
  const bool attributes = part.mode == "ATTRIBUTES";
  const bool triangles = part.mode == "TRIANGLES";
  if (!attributes && !triangles && part.mode != "INDICES") {
    return absl::InvalidArgumentError(absl::StrCat("mode '", part.mode, "' is unknown"));
  }
  if (attributes ? part.stride % 4 != 0 || part.stride == 0 || part.stride > 256
                 : part.stride != 2 && part.stride != 4) {
    return absl::InvalidArgumentError(
        absl::StrCat("byteStride is ", part.stride,
                     ", must be a multiple of 4 up to 256 for attributes "
                     "and 2 or 4 for indices"));
  }
  if (triangles && part.count % 3 != 0) {
    return absl::InvalidArgumentError(absl::StrCat("count is ", part.count, ", must divide by 3"));
  }
  if (part.count > kMaxVertices * 6) {
    return absl::InvalidArgumentError(
        absl::StrCat("count is ", part.count, ", the limit is ", kMaxVertices * 6));
  }
  const bool octahedral = part.filter == "OCTAHEDRAL";
  const bool quaternion = part.filter == "QUATERNION";
  const bool exponential = part.filter == "EXPONENTIAL";
  if (!octahedral && !quaternion && !exponential && part.filter != "NONE") {
    return absl::InvalidArgumentError(absl::StrCat("filter '", part.filter, "' is unknown"));
  }
  if ((octahedral && part.stride != 4 && part.stride != 8) || (quaternion && part.stride != 8)) {
    return absl::InvalidArgumentError(absl::StrCat("byteStride is ", part.stride, ", which filter ",
                                                   part.filter, " doesn't have"));
  }

  Bytes plain(part.count * part.stride);
  int failed = 0;
  if (attributes) {
    failed =
        meshopt_decodeVertexBuffer(plain.data(), part.count, part.stride, data.data(), data.size());
  } else if (triangles) {
    failed =
        meshopt_decodeIndexBuffer(plain.data(), part.count, part.stride, data.data(), data.size());
  } else {
    failed = meshopt_decodeIndexSequence(plain.data(), part.count, part.stride, data.data(),
                                         data.size());
  }
  if (failed != 0) return absl::InvalidArgumentError("meshopt data are damaged");
  if (octahedral) meshopt_decodeFilterOct(plain.data(), part.count, part.stride);
  if (quaternion) meshopt_decodeFilterQuat(plain.data(), part.count, part.stride);
  if (exponential) meshopt_decodeFilterExp(plain.data(), part.count, part.stride);
  return plain;
}

#else

absl::StatusOr<Bytes> decode_meshopt(std::span<const std::uint8_t>, const MeshoptPart&) {
  return absl::InvalidArgumentError(
      "needs EXT_meshopt_compression, and this program was built without meshoptimizer");
}

#endif

#ifdef THRONG_WITH_DRACO

absl::StatusOr<DracoMesh> decode_draco(std::span<const std::uint8_t> data, const DracoPart& part) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(data.data()), data.size());
  draco::Decoder decoder;
  auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat("Draco data are damaged: ", decoded.status().error_msg_string()));
  }
  const draco::Mesh& mesh = *decoded.value();
  if (mesh.num_points() > kMaxVertices || mesh.num_faces() > kMaxTriangles) {
    return absl::InvalidArgumentError(absl::StrCat("has ", mesh.num_points(), " vertices and ",
                                                   mesh.num_faces(), " triangles, the limits are ",
                                                   kMaxVertices, " and ", kMaxTriangles));
  }

  DracoMesh result;
  result.vertex_count = mesh.num_points();
  result.indices.reserve(std::size_t{3} * mesh.num_faces());
  for (draco::FaceIndex face(0); face < mesh.num_faces(); ++face) {
    for (const draco::PointIndex& point : mesh.face(face)) result.indices.push_back(point.value());
  }
  for (const auto& [name, id] : part.ids) {
    const draco::PointAttribute* attribute = mesh.GetAttributeByUniqueId(id);
    if (attribute == nullptr || attribute->num_components() < 1 ||
        attribute->num_components() > 4) {
      return absl::InvalidArgumentError(
          absl::StrCat("has no usable Draco attribute ", id, " for ", name));
    }
    DracoMesh::Attribute& out = result.attributes[name];
    out.components = static_cast<std::uint32_t>(attribute->num_components());
    out.values.resize(std::size_t{out.components} * result.vertex_count);
    for (draco::PointIndex point(0); point < mesh.num_points(); ++point) {
      const draco::AttributeValueIndex value = attribute->mapped_index(point);
      if (value.value() >= attribute->size() ||
          !attribute->ConvertValue<float>(
              value, static_cast<std::int8_t>(out.components),
              &out.values[std::size_t{point.value()} * out.components])) {
        return absl::InvalidArgumentError(
            absl::StrCat("vertex ", point.value(), " has no value for ", name));
      }
    }
  }
  return result;
}

#else

absl::StatusOr<DracoMesh> decode_draco(std::span<const std::uint8_t>, const DracoPart&) {
  return absl::InvalidArgumentError(
      "needs KHR_draco_mesh_compression, and this program was built without Draco");
}

#endif

}  // namespace throng::simplify::gltf
