#include "simplify/report/rivals.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>
#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>

#ifdef THRONG_WITH_MESHOPT
#include <meshoptimizer.h>
#endif

extern char** environ;

namespace throng::simplify {
namespace {

constexpr float kAnyError = 1.0e6F;  // triangles are given, whatever it costs
constexpr std::uint32_t kAttributes = 5;
constexpr std::uint32_t kPruneOption = 8;  // meshopt_SimplifyPrune

/// Reads vertices and indices, simplifies to each target and writes the index buffers. The package
/// (0.2.30a0) forgets to say which arguments this function takes, without which ctypes refuses
/// floats.
constexpr const char* kScript = R"(
import sys, ctypes as c, numpy as np, meshoptimizer as m
from meshoptimizer._loader import lib
uints, floats, size = c.POINTER(c.c_uint), c.POINTER(c.c_float), c.c_size_t
lib.meshopt_simplifyWithAttributes.restype = size
lib.meshopt_simplifyWithAttributes.argtypes = [
    uints, uints, size, floats, size, size, floats, size, floats, size, c.POINTER(c.c_ubyte),
    size, c.c_float, c.c_uint, floats]
with open(sys.argv[1], 'rb') as f:
    vertices, indices, targets, attributes, prune = np.frombuffer(f.read(20), np.uint32).tolist()
    target = np.frombuffer(f.read(4 * targets), np.uint32)
    weight = np.frombuffer(f.read(4 * attributes), np.float32)
    position = np.frombuffer(f.read(12 * vertices), np.float32).reshape(vertices, 3)
    attribute = np.frombuffer(f.read(4 * attributes * vertices), np.float32)
    attribute = attribute.reshape(vertices, attributes)
    index = np.frombuffer(f.read(4 * indices), np.uint32)
with open(sys.argv[2], 'wb') as f:
    for t in target.tolist():
        for options in (0, prune):
            other = np.zeros(indices, np.uint32)
            count = m.simplify_with_attributes(other, index, position, attribute, weight,
                                            target_index_count=3 * t, target_error=1e6,
                                            options=options)
            if options == 0 or 1.5 * t <= count < n:
                n, out = count, other
            if n <= 3.06 * t:
                break
        f.write(np.array([n], np.uint32).tobytes() + out[:n].tobytes())
)";
constexpr const char* kVersionScript = R"(
import sys, meshoptimizer, importlib.metadata as d
open(sys.argv[1], 'w').write(d.version('meshoptimizer'))
)";

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "throng_report_XXXXXX").string();
    if (::mkdtemp(name.data()) != nullptr) path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code error;
    if (!path_.empty()) std::filesystem::remove_all(path_, error);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  std::string file(const char* name) const { return path_ + "/" + name; }
  bool is_there() const { return !path_.empty(); }

 private:
  std::string path_;
};

std::string last_line(const std::string& path) {
  std::ifstream file(path);
  std::string line, last;
  while (std::getline(file, line)) {
    if (!line.empty()) last = line;
  }
  return last;
}

/// Runs `python -c script arguments...`; Unavailable with the last line it wrote to stderr.
absl::Status run_python(const std::string& python, const char* script,
                        std::vector<std::string> arguments, const std::string& errors) {
  std::vector<std::string> words{python, "-c", script};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, errors.c_str(),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t child = 0;
  const int failed =
      ::posix_spawnp(&child, python.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) return absl::UnavailableError(absl::StrCat(python, ": ", std::strerror(failed)));
  int state = 0;
  while (::waitpid(child, &state, 0) < 0 && errno == EINTR) {
  }
  if (WIFEXITED(state) && WEXITSTATUS(state) == 0) return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat(python, ": ", last_line(errors)));
}

/// Flags go by vertex: wedges of two materials are never one.
LevelMesh mesh_of(const render::Character& character, std::span<const unsigned int> indices) {
  std::vector<std::uint8_t> vertex_flags(character.vertex_count());
  for (std::uint32_t t = 0; t < character.triangle_count(); ++t) {
    for (int k = 0; k < 3; ++k)
      vertex_flags[character.triangle[t][k]] |= character.triangle_flags[t];
  }
  LevelMesh mesh;
  std::vector<bool> is_used(character.vertex_count());
  for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
    const glm::uvec3 corner(indices[i], indices[i + 1], indices[i + 2]);
    mesh.triangles.push_back(corner);
    mesh.triangle_flags.push_back(static_cast<std::uint8_t>(
        vertex_flags[corner.x] & vertex_flags[corner.y] & vertex_flags[corner.z]));
    for (int k = 0; k < 3; ++k) {
      mesh.vertices += is_used[corner[k]] ? 0 : 1;
      is_used[corner[k]] = true;
    }
  }
  return mesh;
}

template <typename T>
void write_values(std::ofstream& file, const T* values, std::size_t count) {
  file.write(reinterpret_cast<const char*>(values),
             static_cast<std::streamsize>(count * sizeof(T)));
}

}  // namespace

std::string plain_meshoptimizer_version() {
#ifdef THRONG_WITH_MESHOPT
  return absl::StrCat(MESHOPTIMIZER_VERSION / 1000, ".", MESHOPTIMIZER_VERSION % 1000 / 10);
#else
  return "";
#endif
}

absl::StatusOr<std::vector<LevelMesh>> simplify_plain(
    [[maybe_unused]] const render::Character& character,
    [[maybe_unused]] std::span<const std::uint32_t> triangles) {
#ifdef THRONG_WITH_MESHOPT
  std::vector<LevelMesh> levels;
  std::vector<unsigned int> result(std::size_t{3} * character.triangle_count());
  for (const std::uint32_t target : triangles) {
    const std::size_t count =
        meshopt_simplify(result.data(), &character.triangle[0].x, result.size(),
                         &character.position[0].x, character.vertex_count(), sizeof(glm::vec3),
                         std::size_t{3} * target, kAnyError, 0, nullptr);
    levels.push_back(mesh_of(character, std::span(result).first(count)));
  }
  return levels;
#else
  return absl::UnimplementedError("this program was built without libmeshoptimizer");
#endif
}

absl::StatusOr<std::vector<LevelMesh>> simplify_with_attributes(
    const render::Character& character, std::span<const std::uint32_t> triangles,
    const std::string& python, const AttributeWeights& weights) {
  const TemporaryFolder folder;
  if (!folder.is_there()) return absl::UnavailableError("no folder for temporary files");
  {
    std::ofstream file(folder.file("in"), std::ios::binary);
    const std::uint32_t header[] = {character.vertex_count(), 3 * character.triangle_count(),
                                    static_cast<std::uint32_t>(triangles.size()), kAttributes,
                                    kPruneOption};
    const float weight[kAttributes] = {weights.normal, weights.normal, weights.normal, weights.uv,
                                       weights.uv};
    write_values(file, header, std::size(header));
    write_values(file, triangles.data(), triangles.size());
    write_values(file, weight, kAttributes);
    write_values(file, character.position.data(), character.position.size());
    for (std::uint32_t i = 0; i < character.vertex_count(); ++i) {
      const glm::vec3 normal = render::decode_octahedral(character.normal[i]);
      const glm::vec2 uv = glm::vec2(character.uv[i]) / 65535.0F;
      const float attributes[kAttributes] = {normal.x, normal.y, normal.z, uv.x, uv.y};
      write_values(file, attributes, kAttributes);
    }
    write_values(file, character.triangle.data(), character.triangle.size());
    file.flush();
    if (!file) return absl::UnavailableError(absl::StrCat(folder.file("in"), ": can't be written"));
  }
  if (auto status = run_python(python, kScript, {folder.file("in"), folder.file("out")},
                               folder.file("errors"));
      !status.ok()) {
    return status;
  }
  std::vector<LevelMesh> levels;
  std::ifstream file(folder.file("out"), std::ios::binary);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    std::uint32_t count = 0;
    file.read(reinterpret_cast<char*>(&count), sizeof(count));
    if (!file || count > 3 * character.triangle_count())
      return absl::UnavailableError(absl::StrCat(python, ": wrote no level of ", triangles[i]));
    std::vector<unsigned int> indices(count);
    file.read(reinterpret_cast<char*>(indices.data()), std::streamsize{4} * count);
    if (!file) return absl::UnavailableError(absl::StrCat(python, ": wrote half a level"));
    for (const unsigned int index : indices) {
      if (index >= character.vertex_count())
        return absl::UnavailableError(absl::StrCat(python, ": wrote vertex ", index));
    }
    levels.push_back(mesh_of(character, indices));
  }
  return levels;
}

absl::StatusOr<std::string> attribute_meshoptimizer_version(const std::string& python) {
  const TemporaryFolder folder;
  if (!folder.is_there()) return absl::UnavailableError("no folder for temporary files");
  if (auto status =
          run_python(python, kVersionScript, {folder.file("version")}, folder.file("errors"));
      !status.ok()) {
    return status;
  }
  return last_line(folder.file("version"));
}

}  // namespace throng::simplify
