#pragma once

#include <string>
#include <utility>
#include <vector>

namespace subworld {

/// Where something stands in a file, from 1.
struct Mark {
  int line = 1;
  int column = 1;
};

/// A piece of a YAML document as it is written: scalars are text, maps keep their order and their duplicate keys.
struct YamlNode {
  enum class Kind { null, scalar, list, map };
  struct Entry;

  Kind kind = Kind::null;
  Mark mark;
  bool quoted = false;          ///< scalar: "5" is not the number 5
  std::string text;             ///< scalar
  std::vector<YamlNode> items;  ///< list
  std::vector<Entry> entries;   ///< map
};

struct YamlNode::Entry {
  std::string key;
  Mark mark;  ///< of the key
  YamlNode value;
};

/// Reads the one YAML document of a file. No anchors, aliases or tags: a scene has none, and without them a small file
/// cannot become a large tree. Throws `Error` (usage) with file:line:column for a file that cannot be read, is larger
/// than 16 MB, or is not such a document.
[[nodiscard]] YamlNode read_yaml(const std::string& file);

}  // namespace subworld
