#include "wire/codec/schema.hpp"

#include "model/error.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <set>
#include <sstream>
#include <utility>
#include <vector>

namespace subworld {
namespace {

/// Names of the fields that an array's elements become.
const std::map<std::string, std::vector<const char*>> kElements{
    {"Vector", {"x", "y", "z"}}, {"Quaternion", {"w", "x", "y", "z"}}, {"Triangle", {"a", "b", "c"}}};

std::string array_as_struct(const std::string& element, const std::string& name, std::size_t size) {
  const auto names = kElements.find(name);
  std::string fields;
  for (std::size_t i = 0; i < size; ++i) {
    const std::string field =
        names != kElements.end() && names->second.size() == size ? names->second[i] : fmt::format("e{}", i);
    fields += fmt::format("  {} {};\n", element, field);
  }
  return fmt::format("@final struct {} {{\n{}}};\n", name, fields);
}

/// Structs by name, in the order of the IDL: a struct comes after those that it consists of.
std::vector<std::pair<std::string, std::string>> definitions_of(const std::string& idl) {
  std::vector<std::pair<std::string, std::string>> found;
  std::istringstream lines(idl);
  bool inside = false;
  for (std::string line; std::getline(lines, line);) {
    line.erase(std::min(line.find("//"), line.size()));
    line.erase(line.find_last_not_of(" \t") + 1);
    if (line.starts_with("typedef ")) {
      const std::size_t bracket = line.find('['), name = line.rfind(' ', bracket) + 1;
      const std::string array = line.substr(name, bracket - name);
      found.emplace_back(array, array_as_struct(line.substr(8, name - 9), array, std::stoul(line.substr(bracket + 1))));
    }
    if (const std::string begin = "@final struct "; line.starts_with(begin)) {
      inside = true;
      found.emplace_back(line.substr(begin.size(), line.find(' ', begin.size()) - begin.size()), "");
    }
    if (inside && !line.empty()) found.back().second += line + "\n";
    inside = inside && line != "};";
  }
  return found;
}

std::set<std::string> words_of(const std::string& text) {
  std::set<std::string> words;
  std::string word;
  for (const char c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_')
      word += c;
    else
      words.insert(std::exchange(word, {}));
  }
  return words;
}

}  // namespace

std::string schema_of(std::string_view idl, const std::string& name) {
  const auto definitions = definitions_of(std::string(idl));
  std::set<std::string> needed{name};
  std::string text;
  for (auto one = definitions.rbegin(); one != definitions.rend(); ++one) {
    if (!needed.contains(one->first)) continue;
    needed.merge(words_of(one->second));
    text = one->second + text;
  }
  if (text.empty()) throw Error(ExitCode::failed, fmt::format("the IDL has no struct {}", name));
  return fmt::format("module subworld {{\nmodule msg {{\n{}}};\n}};\n", text);
}

std::string_view scene_update_schema() {
  return R"(module foxglove {
@final struct Time { uint32 sec; uint32 nsec; };
@final struct Duration { int32 sec; uint32 nsec; };
@final struct Vector3 { double x; double y; double z; };
@final struct Point3 { double x; double y; double z; };
@final struct Quaternion { double x; double y; double z; double w; };
@final struct Pose { Vector3 position; Quaternion orientation; };
@final struct Color { double r; double g; double b; double a; };
@final struct KeyValuePair { string key; string value; };
enum SceneEntityDeletionType { MATCHING_ID, ALL };
@final struct SceneEntityDeletion { Time timestamp; SceneEntityDeletionType type; string id; };
@final struct ArrowPrimitive {
  Pose pose; double shaft_length; double shaft_diameter; double head_length; double head_diameter; Color color;
};
@final struct CubePrimitive { Pose pose; Vector3 size; Color color; };
@final struct SpherePrimitive { Pose pose; Vector3 size; Color color; };
@final struct CylinderPrimitive { Pose pose; Vector3 size; double bottom_scale; double top_scale; Color color; };
enum LineType { LINE_STRIP, LINE_LOOP, LINE_LIST };
@final struct LinePrimitive {
  LineType type; Pose pose; double thickness; boolean scale_invariant; sequence<Point3> points; Color color;
  sequence<Color> colors; sequence<uint32> indices;
};
@final struct TriangleListPrimitive {
  Pose pose; sequence<Point3> points; Color color; sequence<Color> colors; sequence<uint32> indices;
};
@final struct TextPrimitive {
  Pose pose; boolean billboard; double font_size; boolean scale_invariant; Color color; string text;
};
@final struct ModelPrimitive {
  Pose pose; Vector3 scale; Color color; boolean override_color; string url; string media_type; sequence<uint8> data;
};
@final struct SceneEntity {
  Time timestamp; string frame_id; string id; Duration lifetime; boolean frame_locked;
  sequence<KeyValuePair> metadata; sequence<ArrowPrimitive> arrows; sequence<CubePrimitive> cubes;
  sequence<SpherePrimitive> spheres; sequence<CylinderPrimitive> cylinders; sequence<LinePrimitive> lines;
  sequence<TriangleListPrimitive> triangles; sequence<TextPrimitive> texts; sequence<ModelPrimitive> models;
};
@final struct SceneUpdate { sequence<SceneEntityDeletion> deletions; sequence<SceneEntity> entities; };
};
)";
}

}  // namespace subworld
