#include "simplify/import/primitive.hpp"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "simplify/import/accessor.hpp"
#include "simplify/import/compressed.hpp"
#include "simplify/import/limits.hpp"

namespace throng::simplify::gltf {
namespace {

/// Attributes by name, wherever they are stored.
class Source {
 public:
  Source(const Document& document, const Primitive& primitive)
      : document_(document), primitive_(primitive) {}

  absl::Status open() {
    if (!primitive_.draco.has_value()) return absl::OkStatus();
    absl::StatusOr<DracoMesh> mesh =
        decode_draco(document_.bytes(document_.views[primitive_.draco->view]), *primitive_.draco);
    if (!mesh.ok()) return mesh.status();
    draco_ = *std::move(mesh);
    return absl::OkStatus();
  }

  const std::optional<DracoMesh>& draco() const { return draco_; }

  bool has(const std::string& name) const { return primitive_.attributes.contains(name); }

  std::string describe(const std::string& name) const {
    const auto found = primitive_.attributes.find(name);
    return found == primitive_.attributes.end()
               ? name
               : absl::StrCat("accessor ", found->second, " (", name, ")");
  }

  absl::StatusOr<Table<float>> floats(const std::string& name, bool force_normalized) const {
    if (const DracoMesh::Attribute* packed = find_draco(name)) {
      return Table<float>{packed->components, draco_->vertex_count, packed->values};
    }
    const std::uint32_t accessor = primitive_.attributes.at(name);
    if (document_.accessors[accessor].count > kMaxVertices) {
      return absl::InvalidArgumentError(absl::StrCat("accessor ", accessor, " has ",
                                                     document_.accessors[accessor].count,
                                                     " vertices, the limit is ", kMaxVertices));
    }
    return read_floats(document_, accessor, force_normalized);
  }

  absl::StatusOr<Table<std::uint32_t>> integers(const std::string& name) const {
    if (const DracoMesh::Attribute* packed = find_draco(name)) {
      Table<std::uint32_t> table{packed->components, draco_->vertex_count, {}};
      table.values.reserve(packed->values.size());
      for (const float value : packed->values) {
        table.values.push_back(value >= 0.0F && value < 65536.0F ? static_cast<std::uint32_t>(value)
                                                                 : 65535U);
      }
      return table;
    }
    return read_integers(document_, primitive_.attributes.at(name));
  }

 private:
  const DracoMesh::Attribute* find_draco(const std::string& name) const {
    if (!draco_.has_value()) return nullptr;
    const auto found = draco_->attributes.find(name);
    return found == draco_->attributes.end() ? nullptr : &found->second;
  }

  const Document& document_;
  const Primitive& primitive_;
  std::optional<DracoMesh> draco_;
};

bool is_finite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

absl::Status check_rows(const Source& source, const std::string& name, std::uint32_t components,
                        std::uint32_t low, std::uint32_t high, std::uint64_t count,
                        std::uint64_t expected) {
  if (components < low || components > high) {
    return absl::InvalidArgumentError(absl::StrCat(source.describe(name), " has ", components,
                                                   " numbers a vertex, must have ", low));
  }
  if (count != expected) {
    return absl::InvalidArgumentError(
        absl::StrCat(source.describe(name), " has ", count, " vertices, POSITION has ", expected));
  }
  return absl::OkStatus();
}

absl::Status read_positions(const Source& source, PrimitiveData& data) {
  if (!source.has("POSITION")) return absl::InvalidArgumentError("has no POSITION");
  const absl::StatusOr<Table<float>> table = source.floats("POSITION", false);
  if (!table.ok()) return table.status();
  if (absl::Status rows =
          check_rows(source, "POSITION", table->components, 3, 3, table->count, table->count);
      !rows.ok()) {
    return rows;
  }
  if (table->count == 0 || table->count > kMaxVertices) {
    return absl::InvalidArgumentError(absl::StrCat(source.describe("POSITION"), " has ",
                                                   table->count, " vertices, must have 1 to ",
                                                   kMaxVertices));
  }
  data.positions.reserve(table->count);
  for (std::uint64_t i = 0; i < table->count; ++i) {
    const float* row = table->row(i);
    const glm::vec3 position(row[0], row[1], row[2]);
    if (!is_finite(position) || glm::any(glm::greaterThan(glm::abs(position), glm::vec3(1e9F)))) {
      return absl::InvalidArgumentError(absl::StrCat(source.describe("POSITION"), " vertex ", i,
                                                     " is (", row[0], ", ", row[1], ", ", row[2],
                                                     "), must be finite and at most 1e9"));
    }
    data.positions.push_back(position);
  }
  return absl::OkStatus();
}

absl::Status read_attributes(const Source& source, const Primitive& primitive,
                             PrimitiveData& data) {
  const std::uint64_t count = data.positions.size();
  if (source.has("NORMAL")) {
    const absl::StatusOr<Table<float>> table = source.floats("NORMAL", true);
    if (!table.ok()) return table.status();
    if (absl::Status rows =
            check_rows(source, "NORMAL", table->components, 3, 3, table->count, count);
        !rows.ok()) {
      return rows;
    }
    for (std::uint64_t i = 0; i < count; ++i) {
      const glm::vec3 normal(table->row(i)[0], table->row(i)[1], table->row(i)[2]);
      // zero stands for "not given"; such corners are computed
      data.normals.push_back(is_finite(normal) && glm::length(normal) > 1e-6F ? normal
                                                                              : glm::vec3(0.0F));
    }
  }
  for (const auto& [name, accessor] : primitive.attributes) {
    std::uint32_t set = 0;
    if (!name.starts_with("TEXCOORD_") || !absl::SimpleAtoi(name.substr(9), &set) ||
        set >= kMaxUvSets) {
      continue;
    }
    const absl::StatusOr<Table<float>> table = source.floats(name, false);
    if (!table.ok()) return table.status();
    if (absl::Status rows = check_rows(source, name, table->components, 2, 2, table->count, count);
        !rows.ok()) {
      return rows;
    }
    std::vector<glm::vec2>& uvs = data.uvs[set];
    for (std::uint64_t i = 0; i < count; ++i) {
      const glm::vec2 uv(table->row(i)[0], table->row(i)[1]);
      const bool usable = std::abs(uv.x) < 1e6F && std::abs(uv.y) < 1e6F;  // false for NaN too
      uvs.push_back(usable ? uv : glm::vec2(0.0F));
    }
  }
  if (source.has("COLOR_0")) {
    const absl::StatusOr<Table<float>> table = source.floats("COLOR_0", true);
    if (!table.ok()) return table.status();
    if (absl::Status rows =
            check_rows(source, "COLOR_0", table->components, 3, 4, table->count, count);
        !rows.ok()) {
      return rows;
    }
    for (std::uint64_t i = 0; i < count; ++i) {
      glm::vec4 color(1.0F);
      for (std::uint32_t c = 0; c < table->components; ++c) {
        const float value = table->row(i)[c];
        color[static_cast<int>(c)] = value >= 0.0F && value <= 1.0F ? value
                                     : value > 1.0F                 ? 1.0F
                                                                    : 0.0F;
      }
      data.colors.push_back(color);
    }
  }
  return absl::OkStatus();
}

absl::Status read_influences(const Source& source, std::size_t joint_count, PrimitiveData& data) {
  const std::uint64_t count = data.positions.size();
  std::uint32_t sets = 0;
  while (sets < kMaxInfluenceSets && source.has(absl::StrCat("JOINTS_", sets))) ++sets;
  data.influence_stride = sets * 4;
  data.influences.resize(count * data.influence_stride);
  for (std::uint32_t set = 0; set < sets; ++set) {
    const std::string joints_name = absl::StrCat("JOINTS_", set);
    const std::string weights_name = absl::StrCat("WEIGHTS_", set);
    if (!source.has(weights_name)) {
      return absl::InvalidArgumentError(
          absl::StrCat("has ", joints_name, " and no ", weights_name));
    }
    const absl::StatusOr<Table<std::uint32_t>> joints = source.integers(joints_name);
    if (!joints.ok()) return joints.status();
    const absl::StatusOr<Table<float>> weights = source.floats(weights_name, true);
    if (!weights.ok()) return weights.status();
    for (const auto& [name, components, rows] :
         {std::tuple(joints_name, joints->components, joints->count),
          std::tuple(weights_name, weights->components, weights->count)}) {
      if (absl::Status status = check_rows(source, name, components, 4, 4, rows, count);
          !status.ok())
        return status;
    }
    for (std::uint64_t i = 0; i < count; ++i) {
      for (std::uint32_t k = 0; k < 4; ++k) {
        Influence& influence = data.influences[i * data.influence_stride + set * 4 + k];
        influence = {joints->row(i)[k], weights->row(i)[k]};
        if (!std::isfinite(influence.weight)) {
          return absl::InvalidArgumentError(
              absl::StrCat(source.describe(weights_name), " vertex ", i, " is not finite"));
        }
        influence.weight = std::clamp(influence.weight, 0.0F, 1e6F);
        if (influence.joint >= joint_count) {
          if (influence.weight > 0.0F) {
            return absl::InvalidArgumentError(absl::StrCat(source.describe(joints_name), " vertex ",
                                                           i, " names joint ", influence.joint,
                                                           ", the skin has ", joint_count));
          }
          influence.joint = 0;
        }
      }
    }
  }
  return absl::OkStatus();
}

absl::Status read_triangles(const Document& document, const Primitive& primitive,
                            const Source& source, PrimitiveData& data) {
  const std::size_t vertex_count = data.positions.size();
  std::vector<std::uint32_t> indices;
  if (source.draco().has_value()) {
    indices = source.draco()->indices;
  } else if (primitive.indices != kNone) {
    absl::StatusOr<Table<std::uint32_t>> table =
        read_integers(document, static_cast<std::uint32_t>(primitive.indices));
    if (!table.ok()) return table.status();
    if (table->components != 1) {
      return absl::InvalidArgumentError(
          absl::StrCat("accessor ", primitive.indices, " (indices) is not SCALAR"));
    }
    indices = std::move(table->values);
  } else {
    indices.resize(vertex_count);
    for (std::size_t i = 0; i < vertex_count; ++i) indices[i] = static_cast<std::uint32_t>(i);
  }
  for (std::size_t i = 0; i < indices.size(); ++i) {
    if (indices[i] >= vertex_count) {
      return absl::InvalidArgumentError(absl::StrCat("accessor ", primitive.indices,
                                                     " (indices) names vertex ", indices[i], " at ",
                                                     i, ", there are ", vertex_count));
    }
  }

  // Draco always holds a plain list, whatever the mode says
  const std::uint32_t mode = source.draco().has_value() ? 4 : primitive.mode;
  const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    if (a == b || b == c || c == a) {
      ++data.degenerate;
    } else {
      data.triangles.push_back({a, b, c});
    }
  };
  if (mode == 4) {
    for (std::size_t i = 0; i + 2 < indices.size(); i += 3)
      add(indices[i], indices[i + 1], indices[i + 2]);
    return absl::OkStatus();
  }
  for (std::size_t i = 0; i + 2 < indices.size(); ++i) {
    if (mode == 6) {
      add(indices[i + 1], indices[i + 2], indices[0]);
    } else if (i % 2 == 0) {
      add(indices[i], indices[i + 1], indices[i + 2]);
    } else {
      add(indices[i], indices[i + 2], indices[i + 1]);
    }
  }
  data.degenerate = 0;  // strips are stitched with such triangles on purpose
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<PrimitiveData> read_primitive(const Document& document, const Primitive& primitive,
                                             std::size_t joint_count) {
  PrimitiveData data;
  if (primitive.mode < 4) {
    data.is_surface = false;
    return data;
  }
  Source source(document, primitive);
  absl::Status status = source.open();
  if (status.ok()) status = read_positions(source, data);
  if (status.ok()) status = read_attributes(source, primitive, data);
  if (status.ok() && joint_count > 0) status = read_influences(source, joint_count, data);
  if (status.ok()) status = read_triangles(document, primitive, source, data);
  if (!status.ok()) return status;
  return data;
}

}  // namespace throng::simplify::gltf
