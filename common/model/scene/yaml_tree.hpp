#pragma once

#include <string>
#include <utility>
#include <vector>

namespace subworld {

/// Position in a file; line and column start at 1.
struct Mark {
  int line = 1;
  int column = 1;
};

/// A node of a YAML document as it is written: scalars are text; maps preserve their order and their duplicate keys.
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
  Mark mark;  ///< position of the key
  YamlNode value;
};

/// Reads a file with one YAML document. Anchors, aliases and tags are refused: a scene does not need them, and without
/// them a small file cannot expand to a large tree. Throws `Error` (usage) with file:line:column for a file that cannot
/// be read, is larger than 16 MB, or is not such a document.
[[nodiscard]] YamlNode read_yaml(const std::string& file);
/// The same of a text. Errors name the file; an empty name: a text of no file, and the errors name no place.
[[nodiscard]] YamlNode parse_yaml(const std::string& file, const std::string& text);

}  // namespace subworld
