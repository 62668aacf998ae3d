#include "model/scene/yaml_tree.hpp"

#include "model/error.hpp"

#include <fmt/core.h>
#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/mark.h>
#include <yaml-cpp/parser.h>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string_view>
#include <system_error>

namespace subworld {

namespace {

constexpr std::uintmax_t kLargestSceneFile = 16U << 20U;  // bytes
constexpr std::size_t kMostNodes = 2'000'000;
constexpr std::size_t kDeepest = 32;

[[noreturn]] void fail(const std::string& file, Mark mark, std::string_view what) {
  if (file.empty()) throw Error(ExitCode::usage, std::string(what));
  throw Error(ExitCode::usage, fmt::format("{}:{}:{}: {}", file, mark.line, mark.column, what));
}

[[noreturn]] void fail(const std::string& file, std::string_view what) {
  throw Error(ExitCode::usage, fmt::format("{}: {}", file, what));
}

/// Builds the tree from the parser's events. The open lists and maps are a stack of values, not pointers, because a
/// parent's storage may move while a child is being read.
class TreeBuilder : public YAML::EventHandler {
 public:
  explicit TreeBuilder(const std::string& file) : file_(file) {}

  [[nodiscard]] YamlNode take() { return std::move(root_); }

  void OnDocumentStart(const YAML::Mark& /*mark*/) override {}
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    close(begin(mark, "", anchor, YamlNode::Kind::null));
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t /*anchor*/) override {
    fail(file_, of(mark), "aliases (*name) are not part of the scene format; write the value out or use \"repeat\"");
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& value) override {
    YamlNode node = begin(mark, tag, anchor, YamlNode::Kind::scalar);
    node.quoted = tag == "!";
    node.text = value;
    close(std::move(node));
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value /*style*/) override {
    open(begin(mark, tag, anchor, YamlNode::Kind::list));
  }
  void OnSequenceEnd() override { close_top(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value /*style*/) override {
    open(begin(mark, tag, anchor, YamlNode::Kind::map));
  }
  void OnMapEnd() override { close_top(); }

 private:
  struct Open {
    YamlNode node;
    bool has_key = false;
    std::string key;
    Mark key_mark;
  };

  static Mark of(const YAML::Mark& mark) { return {mark.line + 1, mark.column + 1}; }

  YamlNode begin(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor, YamlNode::Kind kind) {
    if (++count_ > kMostNodes)
      fail(file_, of(mark), fmt::format("more than {} values in one file; use \"repeat\" for many bodies", kMostNodes));
    if (anchor != 0) {
      fail(file_, of(mark), "anchors (&name) are not part of the scene format; write the value out or use \"repeat\"");
    }
    if (!tag.empty() && tag != "?" && tag != "!") {
      fail(file_, of(mark), fmt::format("tags ({}) are not part of the scene format; remove it", tag));
    }
    YamlNode node;
    node.kind = kind;
    node.mark = of(mark);
    return node;
  }

  void open(YamlNode node) {
    if (expects_key())
      fail(file_, node.mark, "a key must be a plain word, not a list or a map; check brackets and indentation");
    if (open_.size() == kDeepest)
      fail(file_, node.mark, fmt::format("nested more than {} levels deep; a scene is flat", kDeepest));
    open_.push_back({std::move(node), false, {}, {}});
  }

  void close_top() {
    YamlNode node = std::move(open_.back().node);
    open_.pop_back();
    close(std::move(node));
  }

  [[nodiscard]] bool expects_key() const {
    return !open_.empty() && open_.back().node.kind == YamlNode::Kind::map && !open_.back().has_key;
  }

  /// Called when a value is complete: the document, an item, a key or a key's value.
  void close(YamlNode node) {
    if (open_.empty()) {
      root_ = std::move(node);
      return;
    }
    Open& parent = open_.back();
    if (parent.node.kind == YamlNode::Kind::list) {
      parent.node.items.push_back(std::move(node));
    } else if (!parent.has_key) {
      if (node.kind != YamlNode::Kind::scalar)
        fail(file_, node.mark, "a key must be a plain word; write one before the colon");
      parent.has_key = true;
      parent.key = std::move(node.text);
      parent.key_mark = node.mark;
    } else {
      parent.node.entries.push_back({std::move(parent.key), parent.key_mark, std::move(node)});
      parent.has_key = false;
    }
  }

  const std::string& file_;
  std::size_t count_ = 0;
  std::vector<Open> open_;
  YamlNode root_;
};

std::string read_text(const std::string& file) {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status)) fail(file, "no such file; give the path of a scene, e.g. deploy/scenes/row.yaml");
  if (fs::is_directory(status)) fail(file, "is a directory; give the path of a scene file inside it");
  if (!fs::is_regular_file(status)) fail(file, "is not a regular file; give the path of a scene file");
  const std::uintmax_t size = fs::file_size(file, error);
  if (!error && size > kLargestSceneFile) {
    fail(file, fmt::format("is larger than {} MB; use \"repeat\" for many bodies", kLargestSceneFile >> 20U));
  }
  std::ifstream in(file, std::ios::binary);
  std::ostringstream text;
  if (size > 0) text << in.rdbuf();
  if (!in || !text) fail(file, "cannot be read; check its permissions");
  return std::move(text).str();
}

/// A tab in the indentation, which YAML forbids and no editor shows. Throws `Error` (usage) at the first one.
void refuse_tabs(const std::string& file, const std::string& text) {
  std::istringstream lines(text);
  int number = 1;
  for (std::string line; std::getline(lines, line); ++number) {
    const std::size_t tab = line.find_first_not_of(' ');
    if (tab != std::string::npos && line[tab] == '\t')
      fail(file, {number, static_cast<int>(tab) + 1}, "a tab in the indentation; YAML takes spaces only");
  }
}

}  // namespace

YamlNode read_yaml(const std::string& file) { return parse_yaml(file, read_text(file)); }

YamlNode parse_yaml(const std::string& file, const std::string& content) {
  std::istringstream text(content);
  TreeBuilder builder(file);
  try {
    YAML::Parser parser(text);
    if (!parser.HandleNextDocument(builder)) fail(file, {}, "is empty; a scene needs at least bodies and users");
    YamlNode root = builder.take();
    TreeBuilder second(file);
    if (parser.HandleNextDocument(second)) {
      fail(file, second.take().mark, "a second document; a scene is one document, remove \"---\"");
    }
    return root;
  } catch (const YAML::Exception& e) {
    refuse_tabs(file, content);
    const Mark mark = e.mark.is_null() ? Mark{} : Mark{e.mark.line + 1, e.mark.column + 1};
    fail(file, mark,
         fmt::format("not YAML: {}; check indentation, brackets and quotes; a text with \": \" in it needs quotes",
                     e.msg));
  }
}

}  // namespace subworld
