#pragma once

#include "model/scene/scene.hpp"
#include "model/slips.hpp"

#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace subworld {

class YamlValue;

/// The member that holds a setting; an `unsigned char` is an enumeration. Null: an operator's, where there is none.
using SettingMember = std::variant<double*, std::optional<double>*, int*, std::optional<int>*, std::uint64_t*, bool*,
                                   std::string*, Vec3*, unsigned char*>;

/// A row of the table of settings. From it come the reader of scenes, --set and its short forms, --help, the settings
/// that programs must share, the summary, the axes of the labs, and the table on the page of the scenes.
struct Setting {
  /// A number's limits, or the words of an enumeration in its order.
  struct Range {
    Range(const Limits& of = {}) : limits(of) {}
    Range(std::initializer_list<std::string_view> of) : words(of) {}
    Limits limits;
    std::vector<std::string_view> words;
  };
  std::string key;  ///< in a scene file: below `settings`, or "users." and the key of a user. Its end names its unit
  SettingMember (*member)(Settings&, UserSpec&);
  Range range;
  std::string_view meaning;
  std::string_view readers;         ///< the programs that read it
  std::string_view option = {};     ///< short form of --set; empty: none
  std::string_view otherwise = {};  ///< the default in words, where the member does not say it
  /// Where a value is no plain one: reads it, and gives its text. Without text and member it only sets others.
  void (*read)(const YamlValue&, Settings&, UserSpec&) = nullptr;
  std::string (*text)(const Settings&) = nullptr;

  [[nodiscard]] bool of_user() const noexcept { return key.starts_with("users."); }
  [[nodiscard]] std::string_view unit() const { return unit_of(key); }
};

[[nodiscard]] std::span<const Setting> settings_table();
/// The row of a key, also of one with a user's number as in "users[1].box_half_m". Null: there is none.
[[nodiscard]] const Setting* find_setting(std::string_view key);

/// The value as text, which reads back as the same value; none where it is not set.
[[nodiscard]] std::optional<std::string> value_text(const Setting& setting, Settings& settings, UserSpec& user);
[[nodiscard]] std::string default_text(const Setting& setting);
/// "at least 0 and at most 1", or the words.
[[nodiscard]] std::string range_text(const Setting& setting);

/// A setting as a command line gives it. A key of a user concerns all users, or one: "users[1].box_half_m".
struct SettingChange {
  std::string key;
  std::string value;
  bool operator==(const SettingChange&) const = default;
};
/// "KEY=VALUE".
[[nodiscard]] SettingChange parse_change(const std::string& text);
/// What is wrong, with the cure; empty: nothing.
[[nodiscard]] std::string setting_fault(const SettingChange& change);
/// Changes a scene, in the order of the table; of one setting the last change counts. Throws `Error` (usage).
void apply_changes(std::span<const SettingChange> changes, Scene& scene);

}  // namespace subworld
