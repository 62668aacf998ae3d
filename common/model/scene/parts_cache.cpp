#include "model/scene/parts_cache.hpp"

#include "model/hash.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <bit>
#include <charconv>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <string_view>

namespace subworld {

namespace {

constexpr std::size_t kQuickTriangles = 1000;
constexpr std::uint64_t kMethod = 1;  ///< another number where `convex_parts` finds other parts

std::uint64_t hash_of(const Mesh& mesh, double concavity_m, std::size_t most_parts) {
  std::uint64_t hash = hashed(hashed(kHashSeed, kMethod), most_parts);
  hash = hashed(hash, std::bit_cast<std::uint64_t>(concavity_m));
  for (const Vec3& v : mesh.vertices)
    for (const double x : v) hash = hashed(hash, std::bit_cast<std::uint64_t>(x));
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t corner : triangle) hash = hashed(hash, corner);
  return hash;
}

/// The last line, by which a file is known to be complete.
std::string end_of(std::string_view text) {
  std::uint64_t hash = kHashSeed;
  for (const char c : text) hash = hashed(hash, static_cast<unsigned char>(c));
  return fmt::format("# end {:016x}\n", hash);
}

std::string text_of(const ConvexParts& parts) {
  std::string text = fmt::format(
      "# Subworld: a mesh as convex parts. Without this file they are computed anew.\n# error_m {}\n", parts.error_m);
  std::size_t first = 1;
  for (std::size_t i = 0; i < parts.hulls.size(); ++i) {
    text += fmt::format("o part_{}\n", i);
    for (const Vec3& v : parts.hulls[i].vertices) text += fmt::format("v {} {} {}\n", v.x(), v.y(), v.z());
    for (const auto& [a, b, c] : parts.hulls[i].triangles)
      text += fmt::format("f {} {} {}\n", first + a, first + b, first + c);
    first += parts.hulls[i].vertices.size();
  }
  return text + end_of(text);
}

template <std::size_t N>
std::optional<std::array<double, N>> numbers(std::string_view line) {
  std::array<double, N> values{};
  for (double& value : values) {
    if (line.empty() || line[0] != ' ') return std::nullopt;
    const auto [rest, error] = std::from_chars(line.data() + 1, line.data() + line.size(), value);
    if (error != std::errc{}) return std::nullopt;
    line.remove_prefix(static_cast<std::size_t>(rest - line.data()));
  }
  return values;
}

/// Nothing if the file is missing, not complete, or a folder.
std::optional<ConvexParts> read_parts(const std::filesystem::path& file) {
  if (std::error_code error; !std::filesystem::is_regular_file(file, error)) return std::nullopt;
  std::ifstream stream(file, std::ios::binary);
  const std::string all{std::istreambuf_iterator<char>(stream), {}};
  const std::size_t end = all.rfind("# end ");
  if (end == std::string::npos || all.substr(end) != end_of(std::string_view(all).substr(0, end))) return std::nullopt;
  ConvexParts parts;
  for (std::string_view rest = all; !rest.empty(); rest.remove_prefix(std::min(rest.size(), rest.find('\n') + 1))) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    if (line.starts_with("# error_m ")) {
      if (const auto error = numbers<1>(line.substr(9))) parts.error_m = (*error)[0];
    } else if (line.starts_with("o ")) {
      parts.hulls.emplace_back();
    } else if (line.starts_with("v ") && !parts.hulls.empty()) {
      if (const auto v = numbers<3>(line.substr(1)))
        parts.hulls.back().vertices.emplace_back((*v)[0], (*v)[1], (*v)[2]);
    }
  }
  return parts;
}

/// Whole or not at all, also where several programs write it at once.
bool write_parts(const std::filesystem::path& file, const std::string& text) {
  std::error_code error;
  std::filesystem::create_directories(file.parent_path(), error);
  const std::filesystem::path unfinished = fmt::format("{}.{}", file.string(), getpid());
  std::ofstream stream(unfinished, std::ios::binary);
  stream << text;
  stream.close();
  if (stream) std::filesystem::rename(unfinished, file, error);
  if (stream && !error) return true;
  std::filesystem::remove(unfinished, error);
  return false;
}

}  // namespace

ConvexParts cached_parts(const Mesh& closed, double concavity_m, std::size_t most_parts, const std::string& scene_file,
                         std::string& file) {
  const std::string name = fmt::format("parts-{:016x}.obj", hash_of(closed, concavity_m, most_parts));
  std::vector<std::filesystem::path> places{std::filesystem::path(scene_file).parent_path() / ".subworld" / name};
  if (const char* const caches = std::getenv("XDG_CACHE_HOME"); caches != nullptr && *caches == '/') {
    places.push_back(std::filesystem::path(caches) / "subworld" / name);
  } else if (const char* const home = std::getenv("HOME"); home != nullptr && *home == '/') {
    places.push_back(std::filesystem::path(home) / ".cache/subworld" / name);
  }
  for (const std::filesystem::path& place : places) {
    file = place.string();
    if (auto known = read_parts(place)) return *std::move(known);
  }
  if (closed.triangles.size() > kQuickTriangles)
    fmt::print(stderr, "subworld: dividing {} into convex parts, once; this may take a minute\n", closed.file);
  ConvexParts parts = convex_parts(closed, concavity_m, most_parts);
  const std::string text = text_of(parts);
  file.clear();
  for (const std::filesystem::path& place : places) {
    if (!write_parts(place, text)) continue;
    file = place.string();
    break;
  }
  return parts;
}

}  // namespace subworld
