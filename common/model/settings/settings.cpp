#include "model/settings/settings.hpp"

#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/scene/scene_reader.hpp"
#include "model/shapes/nearest.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <type_traits>

namespace subworld {

namespace {

/// Keys of a scene file that are no settings.
constexpr std::array<std::string_view, 4> kOfFiles{"users.name", "users.proxy", "users.joins", "users.device.path"};

/// "users.device.mass_kg" of "users[1].device.mass_kg", or of "settings.users...". `user`: its number.
std::string plain_key(std::string_view key, std::optional<std::size_t>& user) {
  constexpr std::string_view kRoot = "settings.", kUsers = "users[";
  if (key.starts_with(kRoot)) key.remove_prefix(kRoot.size());
  const std::size_t close = key.find(']');
  if (!key.starts_with(kUsers) || close == std::string_view::npos) return std::string(key);
  std::size_t number = 0;
  const char* const end = key.data() + close;
  if (std::from_chars(key.data() + kUsers.size(), end, number).ptr != end) return std::string(key);
  user = number;
  return fmt::format("users{}", key.substr(close + 1));
}

/// For an unknown key.
std::string hint_of(const std::string& key) {
  std::vector<std::string_view> keys, ends;
  for (const Setting& one : settings_table()) {
    keys.push_back(one.key);
    ends.push_back(keys.back().substr(one.key.rfind('.') + 1));
  }
  std::string_view near = nearest(key, keys);
  if (near.empty()) {
    const auto end = std::ranges::find(ends, nearest(key, ends));
    if (end != ends.end()) near = keys[static_cast<std::size_t>(end - ends.begin())];
  }
  return near.empty() ? "`subworld plan --settings` lists them" : fmt::format("did you mean {}?", near);
}

/// An operator exists where one of its keys is set.
void add_operator(std::string_view key, UserSpec& user) {
  if (key.starts_with("users.device.operator.") && !user.device.operator_model) user.device.operator_model.emplace();
}

void read(const Setting& setting, const YamlValue& value, Settings& settings, UserSpec& user) {
  if (setting.read != nullptr) return setting.read(value, settings, user);
  add_operator(setting.key, user);
  const Limits& limits = setting.range.limits;
  const auto into = [&]<class T>(T* at) {
    if constexpr (std::is_same_v<T, unsigned char>) {
      *at = static_cast<unsigned char>(value.choice(setting.range.words));
    } else if constexpr (std::is_same_v<T, bool>) {
      *at = value.flag();
    } else if constexpr (std::is_same_v<T, std::string>) {
      *at = value.name();
    } else if constexpr (std::is_same_v<T, Vec3>) {
      *at = value.vec3(limits);
    } else if constexpr (std::is_same_v<T, double> || std::is_same_v<T, std::optional<double>>) {
      *at = value.number(limits);
    } else {
      *at = static_cast<T>(value.integer(static_cast<int>(limits.least), static_cast<int>(limits.most)));
    }
  };
  std::visit(into, setting.member(settings, user));
}

/// Sets it as a scene file would. Throws `Error` (usage) without a place.
void read(const Setting& setting, const std::string& text, Settings& settings, UserSpec& user) {
  const std::string no_file;
  YamlNode node{};
  node.kind = YamlNode::Kind::scalar;
  node.text = text;
  if (text.starts_with('[')) node = parse_yaml(no_file, text);
  read(setting, YamlValue(no_file, setting.key, node, {}), settings, user);
}

}  // namespace

const Setting* find_setting(std::string_view key) {
  std::optional<std::size_t> user;
  const auto found = std::ranges::find(settings_table(), plain_key(key, user), &Setting::key);
  return found == settings_table().end() ? nullptr : &*found;
}

std::vector<std::string_view> keys_in(std::string_view group) {
  std::vector<std::string_view> keys;
  const auto add = [&](std::string_view key) {
    if (!key.starts_with(group)) return;
    key = key.substr(group.size(), key.find('.', group.size()) - group.size());
    if (std::ranges::find(keys, key) == keys.end()) keys.push_back(key);
  };
  for (const Setting& one : settings_table()) add(one.key);
  for (const std::string_view key : kOfFiles) add(key);
  return keys;
}

void read_settings(const YamlValue& value, const std::string& group, Settings& settings, UserSpec& user) {
  const std::vector<std::string_view> keys = keys_in(group);
  Faults faults;
  const YamlMap map(value, keys, faults);
  add_operator(group, user);
  for (const std::string_view key : keys) {
    faults.collect([&] {
      const auto at = map.find(key);
      const std::string full = group + std::string(key);
      if (!at || std::ranges::find(kOfFiles, full) != kOfFiles.end()) return;
      if (const Setting* const one = find_setting(full)) {
        read(*one, *at, settings, user);
      } else {
        read_settings(*at, full + ".", settings, user);
      }
    });
  }
  faults.raise();
}

std::optional<std::string> value_text(const Setting& setting, Settings& settings, UserSpec& user) {
  if (setting.text != nullptr) return setting.text(settings);
  if (setting.member == nullptr) return std::nullopt;
  const auto text = [&]<class T>(const T* at) -> std::optional<std::string> {
    if (at == nullptr) return std::nullopt;
    if constexpr (std::is_same_v<T, unsigned char>) {
      return std::string(setting.range.words[*at]);
    } else if constexpr (std::is_same_v<T, Vec3>) {
      return fmt::format("[{}, {}, {}]", at->x() + 0.0, at->y() + 0.0, at->z() + 0.0);
    } else if constexpr (std::is_same_v<T, double>) {
      return fmt::format("{}", *at + 0.0);  // -0 and 0 are the same scene
    } else if constexpr (requires { at->has_value(); }) {
      return *at ? std::optional(fmt::format("{}", **at)) : std::nullopt;
    } else {
      return fmt::format("{}", *at);
    }
  };
  return std::visit(text, setting.member(settings, user));
}

std::string default_text(const Setting& setting) {
  Settings settings;
  UserSpec user;
  add_operator(setting.key, user);
  return setting.otherwise.empty() ? value_text(setting, settings, user).value_or("0") : std::string(setting.otherwise);
}

std::string range_text(const Setting& setting) {
  return setting.range.words.empty() ? to_text(setting.range.limits) : joined(setting.range.words, ", ");
}

SettingChange parse_change(const std::string& text) {
  const std::size_t equals = text.find('=');
  return equals == std::string::npos ? SettingChange{text, ""}
                                     : SettingChange{text.substr(0, equals), text.substr(equals + 1)};
}

std::string setting_fault(const SettingChange& change) {
  const Setting* const setting = find_setting(change.key);
  if (setting == nullptr) return fmt::format("unknown setting; {}", hint_of(change.key));
  Settings settings;
  UserSpec user;
  try {
    read(*setting, change.value, settings, user);
  } catch (const Error& wrong) {
    return wrong.what();
  }
  return {};
}

void apply_changes(std::span<const SettingChange> changes, Scene& scene) {
  UserSpec none;
  for (const Setting& setting : settings_table()) {
    for (const SettingChange& change : changes) {
      std::optional<std::size_t> number;
      if (plain_key(change.key, number) != setting.key) continue;
      if (number && *number >= scene.users.size())
        throw Error(ExitCode::usage, fmt::format("{}: the scene has {} users, from 0", change.key, scene.users.size()));
      if (!setting.of_user()) read(setting, change.value, scene.settings, none);
      for (std::size_t u = 0; setting.of_user() && u < scene.users.size(); ++u) {
        if (!number || *number == u) read(setting, change.value, scene.settings, scene.users[u]);
      }
    }
  }
}

}  // namespace subworld
