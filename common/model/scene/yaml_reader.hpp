#pragma once

#include "model/error.hpp"
#include "model/scene/yaml_tree.hpp"
#include "model/slips.hpp"
#include "model/types.hpp"

#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

inline constexpr Limits kAny{};
inline constexpr Limits kNotNegative{.least = 0.0};
inline constexpr Limits kPositive{.least = 0.0, .above = true};
inline constexpr Limits kUnit{.least = 0.0, .most = 1.0};

/// A value of the file that knows where it stands. Every access is strict and throws `Error` (usage) as
/// "file:line:column: key.path: what is wrong; cure", or without a file as "what is wrong; cure".
class YamlValue {
 public:
  /// `file` and `node` must outlive the value.
  YamlValue(const std::string& file, std::string path, const YamlNode& node, Mark mark)
      : file_(&file), path_(std::move(path)), node_(&node), mark_(mark) {}

  [[nodiscard]] double number(const Limits& limits = kAny) const;
  [[nodiscard]] int integer(int least, int most) const;
  [[nodiscard]] bool flag() const;
  /// Text that is not empty.
  [[nodiscard]] std::string text() const;
  /// A name: letters, digits, '_', '-' and '.'.
  [[nodiscard]] std::string name() const;
  /// The index in `choices` of the word that is written here.
  [[nodiscard]] std::size_t choice(std::span<const std::string_view> choices) const;
  [[nodiscard]] std::size_t choice(std::initializer_list<std::string_view> choices) const {
    return choice(std::span(choices.begin(), choices.size()));
  }
  [[nodiscard]] std::vector<double> numbers(std::size_t count, const Limits& limits = kAny) const;
  [[nodiscard]] Vec3 vec3(const Limits& limits = kAny) const;
  /// A direction: any length but zero, returned as a unit vector.
  [[nodiscard]] Vec3 direction() const;
  /// The items of a list.
  [[nodiscard]] std::vector<YamlValue> items() const;

  struct Named;
  /// The entries of a map in the file's order; a key that stands twice is an error.
  [[nodiscard]] std::vector<Named> entries() const;

  [[nodiscard]] bool is_scalar() const noexcept { return node_->kind == YamlNode::Kind::scalar; }
  [[nodiscard]] const std::string& path() const noexcept { return path_; }
  [[nodiscard]] const std::string& file() const noexcept { return *file_; }

  /// Throws the error for this place.
  [[noreturn]] void fail(std::string_view what) const;

 private:
  [[nodiscard]] const std::string& scalar(std::string_view expected) const;
  /// The value's place with its path extended: ".key" or "[i]".
  [[nodiscard]] std::string path_of(std::string_view key) const;

  const std::string* file_;
  std::string path_;
  const YamlNode* node_;
  Mark mark_;
};

struct YamlValue::Named {
  std::string key;
  YamlValue at_key;  ///< fails with the key's mark
  YamlValue value;
};

/// The errors of parts of a file that do not depend on each other. They are thrown together as one error, a line each.
class Faults {
 public:
  /// Reads the part. Returns whether it has no error. After `kMost` errors, the other parts are not read.
  template <class Part>
  bool collect(const Part& part) {
    try {
      if (lines_.size() < kMost) part();
      return lines_.size() < kMost;
    } catch (const Error& fault) {
      add(fault.what());
      return false;
    }
  }
  [[nodiscard]] bool any() const noexcept { return !lines_.empty(); }
  /// Throws `Error` (usage) if there are any.
  void raise() const;

 private:
  static constexpr std::size_t kMost = 20;

  /// Adds those lines that are new: a misspelt key is found again where its right name is missing.
  void add(std::string_view text);

  std::vector<std::string> lines_;
};

/// A map whose keys are known: any other key is an error that names the nearest one.
class YamlMap {
 public:
  YamlMap(const YamlValue& value, const std::vector<std::string_view>& keys);
  /// Collects the errors of unknown keys, so that the known ones are read as well.
  YamlMap(const YamlValue& value, const std::vector<std::string_view>& keys, Faults& faults);

  /// Where an unknown key was probably meant to be this one, these throw the unknown key's error.
  [[nodiscard]] bool has(std::string_view key) const { return find(key).has_value(); }
  [[nodiscard]] std::optional<YamlValue> find(std::string_view key) const;
  /// The value of a key that must be there.
  [[nodiscard]] YamlValue at(std::string_view key) const;
  /// Exactly one of the keys must be there; returns its index.
  [[nodiscard]] std::size_t one_of(std::initializer_list<std::string_view> keys) const;
  /// None of the keys may be there, because of `why`.
  void forbid(std::initializer_list<std::string_view> keys, std::string_view why) const;

  /// Keys that may be missing: `target` then keeps what it holds.
  void read(std::string_view key, double& target, const Limits& limits) const;
  void read(std::string_view key, int& target, int least, int most) const;
  void read(std::string_view key, bool& target) const;
  void read(std::string_view key, std::string& target) const;

  [[nodiscard]] const YamlValue& whole() const noexcept { return whole_; }

 private:
  YamlValue whole_;
  std::vector<YamlValue::Named> entries_;
  std::vector<std::pair<std::string, YamlValue>> misspelt_;  ///< by the known key that was probably meant
};

}  // namespace subworld
