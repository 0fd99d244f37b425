#include "render/compute/cpu/cast_table.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <unordered_map>
#include <utility>

#include "render/compute/element/octahedral.hpp"
#include "render/compute/element/stance.hpp"
#include "render/crowd/motion_graph.hpp"

namespace throng::render {
namespace {

TableVertex table_vertex(const glm::vec3& position_m, const glm::i16vec2& normal,
                         const glm::u8vec4& joint_index, const glm::u8vec4& joint_weight,
                         const glm::u16vec2& uv) {
  TableVertex vertex;
  vertex.position_m = position_m;
  vertex.normal = element::unpack_octahedral(normal);
  vertex.joint_index = joint_index;
  vertex.uv = uv;
  const glm::vec4 weight = element::joint_weights(joint_weight);
  for (int k = 0; k < 4; ++k) {
    vertex.weight[k] = weight[k];
    // so that a joint nobody needs is not looked at
    if (weight[k] == 0.0F) vertex.joint_index[k] = vertex.joint_index[0];
  }
  return vertex;
}

std::vector<TableVertex> table_vertices(const Character& character) {
  std::vector<TableVertex> result;
  result.reserve(character.vertex_count());
  for (std::size_t i = 0; i < character.vertex_count(); ++i) {
    result.push_back(table_vertex(character.position[i], character.normal[i],
                                  character.joint_index[i], character.joint_weight[i],
                                  character.uv[i]));
  }
  return result;
}

std::vector<TableVertex> table_points(const Character& character) {
  std::vector<TableVertex> result;
  result.reserve(character.points.count());
  for (const SurfacePoint& point : character.points.point) {
    result.push_back(
        table_vertex(point.position, point.normal, point.joint_index, point.joint_weight, {}));
  }
  return result;
}

std::vector<element::JointMatrix> columns_of(std::span<const Affine> palette) {
  std::vector<element::JointMatrix> result(palette.size());
  for (std::size_t i = 0; i < palette.size(); ++i) {
    for (int c = 0; c < 4; ++c) {
      for (int r = 0; r < 3; ++r) result[i].m[4 * c + r] = palette[i].row[r][c];
      result[i].m[4 * c + 3] = 0.0F;
    }
  }
  return result;
}

/// What the spans of a CharacterTable look into.
struct CharacterColumns {
  std::vector<TableVertex> vertex, point;
  std::vector<element::JointMatrix> palette;
  std::vector<std::uint32_t> joint_order, joint_count_at;
  std::vector<LadderLevel> ladder;
};

void order_joints(CharacterColumns& table, std::uint32_t joint_count) {
  std::vector<bool> is_known(joint_count, false);
  table.joint_count_at.push_back(0);
  const auto add = [&](const TableVertex& vertex) {
    for (int k = 0; k < 4; ++k) {
      const std::uint8_t joint = vertex.joint_index[k];
      if (is_known[joint]) continue;
      is_known[joint] = true;
      table.joint_order.push_back(joint);
    }
  };
  for (const TableVertex& vertex : table.vertex) {
    add(vertex);
    table.joint_count_at.push_back(static_cast<std::uint32_t>(table.joint_order.size()));
  }
  // points are skinned with all joints that there are
  for (const TableVertex& point : table.point) add(point);
  table.joint_count_at.back() = static_cast<std::uint32_t>(table.joint_order.size());
}

std::vector<LadderLevel> make_ladder(const Character& character) {
  std::vector<LadderLevel> ladder;
  for (const std::uint32_t n : level_counts(character)) {
    ladder.push_back({n, level_corners(character, n)});
  }
  std::reverse(ladder.begin(), ladder.end());
  return ladder;
}

void fill_columns(const Character& character, CharacterTable& entry) {
  auto columns = std::make_shared<CharacterColumns>();
  columns->vertex = table_vertices(character);
  columns->point = table_points(character);
  columns->palette = columns_of(character.palette);
  order_joints(*columns, character.joint_count());
  columns->ladder = make_ladder(character);
  entry.vertex = columns->vertex;
  entry.point = columns->point;
  entry.palette = columns->palette;
  entry.joint_order = columns->joint_order;
  entry.joint_count_at = columns->joint_count_at;
  entry.ladder = columns->ladder;
  entry.error = make_error_table(character);
  entry.columns = std::move(columns);
}

}  // namespace

absl::StatusOr<std::shared_ptr<const CastTable>> make_cast_table(std::shared_ptr<const Cast> cast,
                                                                 const CastTable* before) {
  if (cast == nullptr) return absl::InvalidArgumentError("upload: the cast is missing");
  auto table = std::make_shared<CastTable>();
  const MotionGraph motions = motion_graph_of(*cast);
  std::unordered_map<const void*, const CharacterTable*> known_columns;
  if (before != nullptr) {
    for (const CharacterTable& entry : before->characters) {
      const void* storage = entry.character->storage.get();
      if (storage != nullptr) known_columns.emplace(storage, &entry);
    }
  }
  for (std::size_t m = 0; m < cast->members.size(); ++m) {
    const Character& character = cast->members[m].character;
    const std::size_t joints = character.joint_count();
    if (character.vertex_count() == 0 || joints == 0 || character.palette.size() < joints ||
        character.coarsest_count == 0) {
      return absl::InvalidArgumentError(
          absl::StrCat("upload: cast member ", m, " ('", character.name, "') has ",
                       character.vertex_count(), " vertices, ", joints, " joints, ",
                       character.palette.size(), " palette entries and a coarsest level of ",
                       character.coarsest_count, " vertices; each must be at least 1"));
    }
    CharacterTable& entry = table->characters.emplace_back();
    const auto known = known_columns.find(character.storage.get());
    if (known != known_columns.end() && same_columns(character, *known->second->character)) {
      entry = *known->second;
    } else {
      fill_columns(character, entry);
    }
    entry.character = &character;
    entry.gait = gait_of(character, motions);
    add_stance_shift(character, entry.gait);
    entry.reach_m = 0.0F;
    for (const glm::vec4& bounds : {character.bounds, character.gait_bounds}) {
      entry.reach_m =
          std::max(entry.reach_m, glm::length(glm::vec3(bounds)) + bounds.w + element::kMostShiftM);
    }
    table->most_joints = std::max(table->most_joints, character.joint_count());
    table->most_vertices = std::max(table->most_vertices, character.vertex_count());
  }
  if (before != nullptr && kept_members(*cast, *before->cast) > 0) {
    table->levels = before->levels;
    set_surroundings(*cast, table->levels);
  } else {
    table->levels = make_levels(*cast);
  }
  table->cast = std::move(cast);
  return table;
}

}  // namespace throng::render
