#include "simplify/import/made_up.hpp"

#include <gtest/gtest.h>

#include <unistd.h>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#include <stb_image_write.h>
#pragma GCC diagnostic pop

namespace throng::simplify::test {
namespace {

std::string joined(const std::vector<std::string>& parts) {
  std::string text;
  for (const std::string& part : parts) text += (text.empty() ? "" : ",") + part;
  return "[" + text + "]";
}

void append_u32(std::vector<std::uint8_t>& out, std::size_t value) {
  for (int i = 0; i < 4; ++i) out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

void collect(void* context, void* data, int size) {
  auto& out = *static_cast<std::vector<std::uint8_t>*>(context);
  const auto* bytes = static_cast<const std::uint8_t*>(data);
  out.insert(out.end(), bytes, bytes + size);
}

bool is_finite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

std::size_t row_count(std::size_t value_count, const std::string& type) {
  if (type == "SCALAR") return value_count;
  if (type == "MAT4") return value_count / 16;
  return value_count / static_cast<std::size_t>(type.back() - '0');
}

}  // namespace

std::string scratch_path(const std::string& name) {
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("throng_import_" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  return (folder / name).string();
}

void write_file(const std::string& path, const std::vector<std::uint8_t>& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()),
             static_cast<std::streamsize>(bytes.size()));
}

std::vector<std::uint8_t> read_bytes(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return std::vector<std::uint8_t>(std::istreambuf_iterator<char>(file), {});
}

int GltfBuilder::add_accessor(int view, int component, std::size_t value_count,
                              const std::string& type, bool normalized) {
  return raw_accessor("{\"bufferView\":" + std::to_string(view) +
                      ",\"componentType\":" + std::to_string(component) + ",\"count\":" +
                      std::to_string(row_count(value_count, type)) + ",\"type\":\"" + type + "\"" +
                      (normalized ? ",\"normalized\":true" : "") + "}");
}

int GltfBuilder::raw_accessor(const std::string& json) {
  accessors_.push_back(json);
  return static_cast<int>(accessors_.size()) - 1;
}

int GltfBuilder::view(const std::vector<std::uint8_t>& bytes, const std::string& extra_json) {
  while (bytes_.size() % 4 != 0) bytes_.push_back(0);
  const std::size_t offset = bytes_.size();
  bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  return raw_view("{\"buffer\":0,\"byteOffset\":" + std::to_string(offset) +
                  ",\"byteLength\":" + std::to_string(bytes.size()) + extra_json + "}");
}

int GltfBuilder::raw_view(const std::string& json) {
  views_.push_back(json);
  return static_cast<int>(views_.size()) - 1;
}

std::string GltfBuilder::box(const glm::vec3& low, const glm::vec3& high,
                             const std::string& more_attributes) {
  std::vector<float> positions;
  for (int i = 0; i < 8; ++i) {
    positions.push_back((i & 1) != 0 ? high.x : low.x);
    positions.push_back((i & 2) != 0 ? high.y : low.y);
    positions.push_back((i & 4) != 0 ? high.z : low.z);
  }
  const std::vector<std::uint16_t> indices = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                              2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
  const std::string position = std::to_string(accessor(positions, "VEC3"));
  const std::string index = std::to_string(accessor(indices, "SCALAR"));
  std::string text = "\"attributes\":{\"POSITION\":";
  text.append(position).append(more_attributes).append("},\"indices\":").append(index);
  return text;
}

std::string GltfBuilder::json(const std::string& buffer_uri) const {
  std::string text = "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":" +
                     std::to_string(bytes_.size()) +
                     (buffer_uri.empty() ? "" : ",\"uri\":\"" + buffer_uri + "\"") + "}]";
  const auto add = [&](const char* key, const std::vector<std::string>& parts) {
    if (!parts.empty()) text += std::string(",\"") + key + "\":" + joined(parts);
  };
  add("bufferViews", views_);
  add("accessors", accessors_);
  add("nodes", nodes);
  add("meshes", meshes);
  add("skins", skins);
  add("animations", animations);
  add("materials", materials);
  add("textures", textures);
  add("images", images);
  add("samplers", samplers);
  return text + extra + "}";
}

std::vector<std::uint8_t> GltfBuilder::glb() const {
  std::string text = json("");
  while (text.size() % 4 != 0) text += ' ';
  std::vector<std::uint8_t> binary = bytes_;
  while (binary.size() % 4 != 0) binary.push_back(0);
  std::vector<std::uint8_t> out = {'g', 'l', 'T', 'F', 2, 0, 0, 0};
  append_u32(out, 28 + text.size() + binary.size());
  append_u32(out, text.size());
  out.insert(out.end(), {'J', 'S', 'O', 'N'});
  out.insert(out.end(), text.begin(), text.end());
  append_u32(out, binary.size());
  out.insert(out.end(), {'B', 'I', 'N', 0});
  out.insert(out.end(), binary.begin(), binary.end());
  return out;
}

GltfBuilder one_mesh(GltfBuilder builder, const std::string& primitive) {
  builder.meshes.push_back("{\"primitives\":[{" + primitive + "}]}");
  if (builder.nodes.empty()) builder.nodes.push_back("{\"mesh\":0}");
  return builder;
}

GltfBuilder bending_post() {
  GltfBuilder builder;
  // rings at y = 0, 0.5, 1 ... 2; the upper half follows the upper joint, the middle both
  std::vector<float> positions;
  std::vector<std::uint8_t> joints;
  std::vector<float> weights;
  std::vector<std::uint16_t> indices;
  for (int ring = 0; ring < 5; ++ring) {
    for (int k = 0; k < 4; ++k) {
      positions.insert(positions.end(), {(k == 0 || k == 3) ? -0.2F : 0.2F,
                                         0.5F * static_cast<float>(ring), k < 2 ? 0.2F : -0.2F});
      joints.insert(joints.end(), {0, 1, 0, 0});
      const float upper = ring < 2 ? 0.0F : ring == 2 ? 0.5F : 1.0F;
      weights.insert(weights.end(), {1.0F - upper, upper, 0.0F, 0.0F});
      if (ring == 4) continue;
      const std::uint16_t a = static_cast<std::uint16_t>(ring * 4 + k);
      const std::uint16_t b = static_cast<std::uint16_t>(ring * 4 + (k + 1) % 4);
      const std::uint16_t up = 4;
      for (const int i : {int{a}, int{b}, b + up, int{a}, b + up, a + up}) {
        indices.push_back(static_cast<std::uint16_t>(i));
      }
    }
  }
  const int position = builder.accessor(positions, "VEC3");
  const int joint = builder.accessor(joints, "VEC4");
  const int weight = builder.accessor(weights, "VEC4");
  const int index = builder.accessor(indices, "SCALAR");
  const std::vector<float> inverse_bind = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0,  0, 1,
                                           1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1};
  const int bind = builder.accessor(inverse_bind, "MAT4");
  const int times = builder.accessor(std::vector<float>{0.0F, 0.5F, 1.0F}, "SCALAR");
  const float half = std::sqrt(0.5F);  // a quarter turn about x: forward
  const int turns =
      builder.accessor(std::vector<float>{0, 0, 0, 1, half, 0, 0, half, 0, 0, 0, 1}, "VEC4");
  const auto number = [](int value) { return std::to_string(value); };
  builder.meshes = {"{\"primitives\":[{\"attributes\":{\"POSITION\":" + number(position) +
                    ",\"JOINTS_0\":" + number(joint) + ",\"WEIGHTS_0\":" + number(weight) +
                    "},\"indices\":" + number(index) + "}]}"};
  builder.nodes = {R"({"mesh":0,"skin":0})", R"({"name":"root","children":[2]})",
                   R"({"name":"bend","translation":[0,1,0]})"};
  builder.skins = {"{\"joints\":[1,2],\"inverseBindMatrices\":" + number(bind) + "}"};
  builder.animations = {
      "{\"name\":\"Walk\",\"samplers\":[{\"input\":" + number(times) +
      ",\"output\":" + number(turns) +
      "}],\"channels\":[{\"sampler\":0,\"target\":{\"node\":2,\"path\":\"rotation\"}}]}"};
  return builder;
}

std::vector<std::uint8_t> png(int width, int height, const glm::u8vec4& color, bool half_clear) {
  std::vector<std::uint8_t> texels;
  for (int i = 0; i < width * height; ++i) {
    const bool is_clear = half_clear && i % width < width / 2;
    texels.insert(texels.end(), {color.r, color.g, color.b, is_clear ? std::uint8_t{0} : color.a});
  }
  std::vector<std::uint8_t> out;
  stbi_write_png_to_func(&collect, &out, width, height, 4, texels.data(), width * 4);
  return out;
}

std::vector<std::uint8_t> jpeg(int width, int height, const glm::u8vec4& color) {
  std::vector<std::uint8_t> texels;
  for (int i = 0; i < width * height; ++i) texels.insert(texels.end(), {color.r, color.g, color.b});
  std::vector<std::uint8_t> out;
  stbi_write_jpg_to_func(&collect, &out, width, height, 3, texels.data(), 95);
  return out;
}

std::vector<glm::vec3> posed(const SourceCharacter& character, const SourceClip& clip,
                             std::uint32_t frame) {
  const std::size_t joints = character.joints.size();
  std::vector<glm::vec3> result;
  for (const SourcePoint& point : character.points) {
    glm::vec4 sum(0.0F);
    for (int k = 0; k < 4; ++k) {
      sum += point.weight[k] *
             (clip.model_from_joint[frame * joints + point.joint[k]] *
              character.joints[point.joint[k]].joint_from_model * glm::vec4(point.position, 1.0F));
    }
    result.emplace_back(sum);
  }
  return result;
}

Extent extent_of(const std::vector<glm::vec3>& points) {
  Extent extent;
  for (const glm::vec3& point : points) {
    extent.low = glm::min(extent.low, point);
    extent.high = glm::max(extent.high, point);
  }
  return extent;
}

Extent extent_of(const SourceCharacter& character) {
  std::vector<glm::vec3> points;
  for (const SourcePoint& point : character.points) points.push_back(point.position);
  return extent_of(points);
}

std::string fault_of(const SourceCharacter& character) {
  const std::size_t joints = character.joints.size();
  if (joints == 0 || joints > 256) return "has " + std::to_string(joints) + " joints";
  if (character.triangles.empty() || character.clips.empty()) return "has no triangle or no clip";
  for (std::size_t j = 0; j < joints; ++j) {
    if (character.joints[j].parent < -1 || character.joints[j].parent >= static_cast<int>(j))
      return "parent order";
    if (character.joints[j].name.empty()) return "nameless joint";
    for (int c = 0; c < 4; ++c) {
      for (int r = 0; r < 4; ++r) {
        if (!std::isfinite(character.joints[j].joint_from_model[c][r]))
          return "inverse bind not finite";
      }
    }
  }
  for (const SourcePoint& point : character.points) {
    float sum = 0.0F;
    for (int k = 0; k < 4; ++k) {
      if (point.joint[k] >= joints) return "joint index";
      if (!(point.weight[k] >= 0.0F)) return "weight sign";
      if (k > 0 && point.weight[k] > point.weight[k - 1]) return "weight order";
      sum += point.weight[k];
    }
    if (!(std::abs(sum - 1.0F) < 1e-4F)) return "weight sum";
    if (!is_finite(point.position)) return "position not finite";
  }
  for (const glm::vec3& normal : character.normals) {
    if (!(std::abs(glm::length(normal) - 1.0F) < 1e-3F)) return "normal length";
  }
  for (const glm::vec2& uv : character.uvs) {
    if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) return "uv not finite";
  }
  for (const SourceTriangle& triangle : character.triangles) {
    if (triangle.material >= character.materials.size()) return "material index";
    for (const SourceCorner& corner : triangle.corner) {
      if (corner.point >= character.points.size() || corner.normal >= character.normals.size() ||
          corner.uv >= character.uvs.size()) {
        return "corner index";
      }
    }
  }
  for (const SourceMaterial& material : character.materials) {
    const SourceImage& image = material.base_color;
    if (image.rgba.size() != std::size_t{4} * image.width_px * image.height_px) return "image size";
  }
  for (const SourceClip& clip : character.clips) {
    if (clip.frame_count == 0 || clip.model_from_joint.size() != clip.frame_count * joints)
      return "clip size";
    if (!(clip.rate_hz > 0.0F && clip.rate_hz < 1e6F)) return "clip rate";
    for (const glm::mat4& matrix : clip.model_from_joint) {
      for (int c = 0; c < 4; ++c) {
        for (int r = 0; r < 4; ++r) {
          if (!std::isfinite(matrix[c][r])) return "clip matrix not finite";
        }
      }
    }
  }
  return "";
}

GltfBuilder rich_file() {
  GltfBuilder b = bending_post();
  const std::vector<float> uvs(40, 0.25F);
  std::vector<std::uint8_t> colors(80, 200);
  colors[5] = 3;
  const auto number = [](int value) { return std::to_string(value); };
  const int uv = b.accessor(uvs, "VEC2");
  const int color = b.accessor(colors, "VEC4", true);
  const int index_view = b.view({0, 3});
  const int value_view = b.view(std::vector<std::uint8_t>(24, 62));
  const int sparse = b.raw_accessor(
      R"({"bufferView":0,"componentType":5126,"count":20,"type":"VEC3","sparse":{"count":2,"indices":{"bufferView":)" +
      number(index_view) + R"(,"componentType":5121},"values":{"bufferView":)" +
      number(value_view) + "}}}");
  std::string& mesh = b.meshes[0];
  mesh.replace(mesh.find("\"POSITION\":0"), 12,
               "\"POSITION\":" + number(sparse) + ",\"TEXCOORD_0\":" + number(uv) +
                   ",\"COLOR_0\":" + number(color));
  mesh.replace(mesh.find("\"indices\""), 9, "\"material\":0,\"indices\"");
  b.materials = {
      R"({"alphaMode":"BLEND","pbrMetallicRoughness":{"baseColorFactor":[1,0.5,1,1],"baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":{"offset":[0.1,0.2],"rotation":0.3,"scale":[2,2]}}}}})"};
  b.textures = {R"({"source":0,"sampler":0})"};
  b.samplers = {R"({"wrapS":33071})"};
  b.images = {"{\"bufferView\":" + number(b.view(png(6, 5, {9, 8, 7, 255}, true))) + "}"};
  b.meshes.push_back("{\"primitives\":[{\"mode\":5," + b.box({0, 0, 0}, {1, 1, 1}) + "}]}");
  b.nodes[2] = R"({"name":"bend","translation":[0,1,0],"children":[3]})";
  b.nodes.push_back(R"({"mesh":1,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,1,2,3,1]})");
  b.extra = R"(,"scene":0,"scenes":[{"nodes":[0,1]}])";
  return b;
}

void mutate(std::vector<std::uint8_t>& bytes, std::size_t json_begin, std::size_t json_end,
            std::mt19937& random) {
  const auto pick = [&](std::size_t begin, std::size_t end) {
    return std::uniform_int_distribution<std::size_t>(begin, end - 1)(random);
  };
  const std::size_t changes = 1 + random() % 4;
  for (std::size_t i = 0; i < changes; ++i) {
    switch (random() % 5) {
      case 0:
        bytes[pick(0, bytes.size())] = static_cast<std::uint8_t>(random());
        break;
      case 1:
        bytes[pick(json_end, bytes.size())] ^= static_cast<std::uint8_t>(1U << random() % 8);
        break;
      default: {
        // digits become other digits, which gives files that are read further before they're
        // refused
        const std::size_t at = pick(json_begin, json_end);
        for (std::size_t k = at; k < json_end; ++k) {
          if (std::isdigit(bytes[k]) != 0) {
            bytes[k] = random() % 8 == 0 ? '-' : static_cast<std::uint8_t>('0' + random() % 10);
            break;
          }
        }
      }
    }
  }
}

std::size_t json_end_of(const std::vector<std::uint8_t>& glb) {
  return 20 + (std::size_t{glb[12]} | std::size_t{glb[13]} << 8 | std::size_t{glb[14]} << 16);
}

}  // namespace throng::simplify::test
