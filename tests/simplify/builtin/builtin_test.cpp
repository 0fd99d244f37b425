#include "simplify/builtin/builtin.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>
#include <thread>

namespace throng::builtin {
namespace {

struct Row {
  const char* name;
  int vertices, triangles, uvs, joints;
};

// Dong & Peng (2019), table 1; which of our characters follows which row
constexpr Row kTable[] = {
    {"commuter", 2975, 5946, 3494, 62},    {"teacher", 3047, 6090, 3746, 44},
    {"builder", 2762, 5520, 3257, 49},     {"manager", 2936, 5868, 3374, 38},
    {"student", 3328, 6652, 4087, 55},     {"grandfather", 2265, 4526, 2649, 46},
    {"grandmother", 3426, 6848, 3990, 45}, {"schoolboy", 2555, 5106, 2960, 50},
    {"schoolgirl", 2846, 5688, 3334, 64},  {"runner", 2483, 4962, 2851, 67},
    {"tourist", 2594, 5184, 3103, 62},     {"pharmacist", 3261, 6518, 3867, 45},
    {"musician", 2489, 4974, 2982, 48},    {"clerk", 2481, 4958, 2939, 55}};

/// Every character is built once for all tests.
const SourceCharacter& character(const std::string& name) {
  static const std::map<std::string, SourceCharacter> kAll = [] {
    std::map<std::string, SourceCharacter> out;
    for (const std::string& n : builtin_names()) out.emplace(n, make_builtin(n));
    return out;
  }();
  return kAll.at(name);
}

class BuiltinTest : public testing::TestWithParam<Row> {
 protected:
  const SourceCharacter& subject() const { return character(GetParam().name); }
};

TEST(BuiltinCastTest, HasOneCharacterForEachRowOfTheTable) {
  std::set<std::string> expected;
  for (const Row& row : kTable) expected.insert(row.name);
  const std::vector<std::string> names = builtin_names();
  EXPECT_EQ(names.size(), expected.size());
  EXPECT_EQ(std::set<std::string>(names.begin(), names.end()), expected);
}

TEST(BuiltinCastTest, UnknownNameGivesEmptyCharacterWithNote) {
  const SourceCharacter nobody = make_builtin("nobody");
  EXPECT_TRUE(nobody.points.empty());
  ASSERT_EQ(nobody.notes.size(), 1U);
  EXPECT_NE(nobody.notes[0].find("nobody"), std::string::npos);
}

TEST(BuiltinCastTest, SameNameGivesSameBytesAlsoFromAnotherThread) {
  SourceCharacter other;
  std::thread thread([&] { other = make_builtin("schoolboy"); });
  const SourceCharacter again = make_builtin("runner");
  thread.join();
  EXPECT_EQ(again.uvs, character("runner").uvs);
  const SourceCharacter& first = character("schoolboy");
  EXPECT_EQ(other.uvs, first.uvs);
  EXPECT_EQ(other.normals, first.normals);
  EXPECT_EQ(other.materials[0].base_color.rgba, first.materials[0].base_color.rgba);
  EXPECT_EQ(other.materials[0].tint_mask.rgba, first.materials[0].tint_mask.rgba);
  ASSERT_EQ(other.clips.size(), first.clips.size());
  for (std::size_t i = 0; i < first.clips.size(); ++i) {
    EXPECT_EQ(other.clips[i].model_from_joint, first.clips[i].model_from_joint);
  }
}

TEST_P(BuiltinTest, CountsFollowTheTableWithinTwoPercent) {
  const Row& row = GetParam();
  const SourceCharacter& c = subject();
  const auto near = [](std::size_t value, int wanted) {
    return std::abs(static_cast<double>(value) - wanted) <= 0.02 * wanted;
  };
  EXPECT_TRUE(near(c.points.size(), row.vertices)) << c.points.size();
  EXPECT_TRUE(near(c.triangles.size(), row.triangles)) << c.triangles.size();
  EXPECT_TRUE(near(c.uvs.size(), row.uvs)) << c.uvs.size();
  EXPECT_EQ(static_cast<int>(c.joints.size()), row.joints);
}

TEST_P(BuiltinTest, SurfaceIsClosedManifoldOfGenusZero) {
  const SourceCharacter& c = subject();
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  std::set<std::uint32_t> used;
  for (const auto& t : c.triangles) {
    for (int i = 0; i < 3; ++i) {
      ++edges[{t.corner[i].point, t.corner[(i + 1) % 3].point}];
      used.insert(t.corner[i].point);
    }
  }
  for (const auto& [edge, count] : edges) {
    ASSERT_EQ(count, 1) << edge.first << " " << edge.second;
    ASSERT_EQ(edges.count({edge.second, edge.first}), 1U) << edge.first << " " << edge.second;
  }
  EXPECT_EQ(used.size(), c.points.size());
  EXPECT_EQ(c.triangles.size(), 2 * c.points.size() - 4);
  const auto euler = static_cast<long>(c.points.size()) - static_cast<long>(edges.size() / 2) +
                     static_cast<long>(c.triangles.size());
  EXPECT_EQ(euler, 2);
}

TEST_P(BuiltinTest, NoTriangleIsDegenerateInSpaceOrTexture) {
  const SourceCharacter& c = subject();
  for (std::size_t i = 0; i < c.triangles.size(); ++i) {
    const auto& t = c.triangles[i].corner;
    const glm::vec3 a = c.points[t[0].point].position, b = c.points[t[1].point].position,
                    d = c.points[t[2].point].position;
    EXPECT_GT(glm::length(glm::cross(b - a, d - a)), 1e-8F) << i;
    const glm::vec2 u = c.uvs[t[1].uv] - c.uvs[t[0].uv], v = c.uvs[t[2].uv] - c.uvs[t[0].uv];
    EXPECT_GT(std::abs(u.x * v.y - u.y * v.x), 1e-10F) << i;
  }
}

TEST_P(BuiltinTest, IndicesNormalsAndCoordinatesAreInRange) {
  const SourceCharacter& c = subject();
  for (const auto& t : c.triangles) {
    for (const auto& corner : t.corner) {
      ASSERT_LT(corner.point, c.points.size());
      ASSERT_LT(corner.normal, c.normals.size());
      ASSERT_LT(corner.uv, c.uvs.size());
    }
  }
  for (const glm::vec2& uv : c.uvs) {
    ASSERT_GE(std::min(uv.x, uv.y), 0.0F);
    ASSERT_LE(std::max(uv.x, uv.y), 1.0F);
  }
  for (const glm::vec3& n : c.normals) ASSERT_NEAR(glm::length(n), 1.0F, 1e-4F);
}

TEST_P(BuiltinTest, WeightsSumToOneStrongestFirst) {
  const SourceCharacter& c = subject();
  for (const auto& p : c.points) {
    float sum = 0.0F;
    for (int i = 0; i < 4; ++i) {
      sum += p.weight[i];
      ASSERT_GE(p.weight[i], 0.0F);
      ASSERT_LT(p.joint[i], c.joints.size());
      if (i > 0) {
        ASSERT_LE(p.weight[i], p.weight[i - 1]);
      }
    }
    ASSERT_NEAR(sum, 1.0F, 1e-5F);
  }
}

TEST_P(BuiltinTest, JointsHaveDistinctNamesAndComeAfterTheirParents) {
  const SourceCharacter& c = subject();
  std::set<std::string> names;
  for (std::size_t j = 0; j < c.joints.size(); ++j) {
    EXPECT_LT(c.joints[j].parent, static_cast<std::int32_t>(j));
    EXPECT_EQ(c.joints[j].parent < 0, j == 0);
    EXPECT_TRUE(names.insert(c.joints[j].name).second) << c.joints[j].name;
  }
}

TEST_P(BuiltinTest, StandsOnTheGroundFacingForward) {
  const SourceCharacter& c = subject();
  glm::vec3 low{10.0F}, high{-10.0F};
  for (const auto& p : c.points) {
    low = glm::min(low, p.position);
    high = glm::max(high, p.position);
  }
  EXPECT_NEAR(low.z, 0.0F, 0.004F);
  EXPECT_GT(high.z, 1.15F);
  EXPECT_LT(high.z, 2.05F);
  const auto joint = [&](const std::string& name) {
    for (const auto& j : c.joints) {
      if (j.name == name) return -glm::vec3(j.joint_from_model[3]);
    }
    return glm::vec3{0.0F};
  };
  EXPECT_GT(joint("left_toes").x, joint("left_foot").x);
  EXPECT_GT(joint("left_hand").y, joint("right_hand").y);
}

TEST_P(BuiltinTest, TextureIsFullSizeAndEveryTintHasItsPlace) {
  const auto& material = subject().materials.at(0);
  EXPECT_EQ(material.base_color.width_px, 2048U);
  EXPECT_EQ(material.base_color.rgba.size(), 2048U * 2048U * 4U);
  const auto& mask = material.tint_mask;
  ASSERT_EQ(mask.rgba.size(), static_cast<std::size_t>(mask.width_px) * mask.height_px * 4);
  std::size_t strong[4] = {0, 0, 0, 0};
  for (std::size_t i = 0; i < mask.rgba.size(); ++i) strong[i % 4] += mask.rgba[i] > 200 ? 1 : 0;
  EXPECT_GT(strong[0], 5000U);
  EXPECT_GT(strong[2] + strong[3], 20000U);
}

INSTANTIATE_TEST_SUITE_P(Cast, BuiltinTest, testing::ValuesIn(kTable),
                         [](const auto& info) { return std::string(info.param.name); });

// the character of Peng et al. (2011): 1,642 vertices after splitting, 2,620 triangles
TEST(BuiltinCountsTest, CountsReplaceThoseOfTheRow) {
  const SourceCharacter made = make_builtin("musician", {.vertices = 1312, .uvs = 1642});
  EXPECT_EQ(made.triangles.size(), 2620u);
  EXPECT_EQ(made.points.size(), 1312u);
  EXPECT_NEAR(static_cast<double>(made.uvs.size()), 1642.0, 0.01 * 1642.0);
}

}  // namespace
}  // namespace throng::builtin
