#include "model/scene/yaml_reader.hpp"

#include "model/joined.hpp"
#include "model/shapes/nearest.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <ranges>
#include <set>

namespace subworld {

namespace {

std::string_view kind_name(YamlNode::Kind kind) {
  switch (kind) {
    case YamlNode::Kind::null:
      return "nothing";
    case YamlNode::Kind::scalar:
      return "a single value";
    case YamlNode::Kind::list:
      return "a list";
    case YamlNode::Kind::map:
      return "a map";
  }
  return "";
}

constexpr std::size_t kShownWords = 80;  // characters of a wrong word that a message repeats

[[noreturn]] void fail_misspelt(const YamlValue& at_key, std::string_view meant) {
  at_key.fail(fmt::format("unknown key; did you mean \"{}\"?", meant));
}

}  // namespace

void YamlValue::fail(std::string_view what) const {
  if (file_->empty()) throw Error(ExitCode::usage, std::string(what));
  throw Error(ExitCode::usage, fmt::format("{}:{}:{}: {}{}{}", *file_, mark_.line, mark_.column, path_,
                                           path_.empty() ? "" : ": ", what));
}

std::string YamlValue::path_of(std::string_view key) const {
  return path_.empty() ? std::string(key) : fmt::format("{}.{}", path_, key);
}

const std::string& YamlValue::scalar(std::string_view expected) const {
  if (node_->kind != YamlNode::Kind::scalar) fail(fmt::format("must be {}, not {}", expected, kind_name(node_->kind)));
  return node_->text;
}

double YamlValue::number(const Limits& limits) const {
  const std::string& text = scalar("a number");
  if (node_->quoted)
    fail(fmt::format("must be a number; remove the quotes around \"{}\"", text.substr(0, kShownWords)));
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool special = text == ".inf" || text == "-.inf" || text == "+.inf" || text == ".nan" || text == ".NaN" ||
                       text == ".Inf" || error == std::errc::result_out_of_range;
  if (special || (error == std::errc{} && !std::isfinite(value)))
    fail("must be a finite number; infinity and NaN are none");
  const char* const after = text.data() + text.size();
  if (const std::string_view unit = unit_of(path_); error == std::errc{} && end != after &&
                                                    std::isalpha(static_cast<unsigned char>(*end)) != 0 &&
                                                    !unit.empty() && unit != kPartUnit)
    fail(fmt::format("must be a number without its unit, which is {}, not \"{}\"", unit, text.substr(0, kShownWords)));
  if (error != std::errc{} || end != after) {
    fail(fmt::format("must be a number, such as 0.5 or 1e-4, not \"{}\"", text.substr(0, kShownWords)));
  }
  if (!limits.contains(value)) {
    const std::string_view unit = unit_of(path_);
    fail(fmt::format("must be {}{}{}, not {}{}", to_text(limits), unit.empty() || unit == kPartUnit ? "" : " ",
                     unit == kPartUnit ? "" : unit, value, likely_slip(value, limits, unit)));
  }
  return value;
}

int YamlValue::integer(int least, int most) const {
  const double value = number({.least = double(least), .most = double(most)});
  if (value != std::floor(value)) fail(fmt::format("must be a whole number, not {}", value));
  return static_cast<int>(value);
}

bool YamlValue::flag() const {
  const std::string& text = scalar("true or false");
  if (node_->quoted || (text != "true" && text != "false")) {
    fail(fmt::format("must be true or false, not \"{}\"", text.substr(0, kShownWords)));
  }
  return text == "true";
}

std::string YamlValue::text() const {
  const std::string& text = scalar("text");
  if (text.empty()) fail("must not be empty; write a word");
  return text;
}

std::string YamlValue::name() const {
  std::string word = text();
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '.';
  };
  if (word.size() > kShownWords) fail(fmt::format("a name has at most {} characters", kShownWords));
  if (!std::all_of(word.begin(), word.end(), allowed)) {
    fail(fmt::format("\"{}\" is not a name; use letters, digits, \"_\", \"-\" and \".\"", word));
  }
  return word;
}

std::size_t YamlValue::choice(std::span<const std::string_view> choices) const {
  const std::string word = text();
  const auto found = std::find(choices.begin(), choices.end(), word);
  if (found == choices.end()) {
    fail(fmt::format("unknown \"{}\"; choose one of {}", word.substr(0, kShownWords), joined(choices, ", ")));
  }
  return static_cast<std::size_t>(found - choices.begin());
}

std::vector<double> YamlValue::numbers(std::size_t count, const Limits& limits) const {
  if (node_->kind != YamlNode::Kind::list) {
    fail(fmt::format("must be a list of {} numbers, not {}", count, kind_name(node_->kind)));
  }
  if (node_->items.size() != count) fail(fmt::format("must have {} numbers, not {}", count, node_->items.size()));
  std::vector<double> values;
  for (const YamlValue& item : items()) values.push_back(item.number(limits));
  return values;
}

Vec3 YamlValue::vec3(const Limits& limits) const {
  const std::vector<double> values = numbers(3, limits);
  return {values[0], values[1], values[2]};
}

Vec3 YamlValue::direction() const {
  const Vec3 value = vec3();
  const double largest = value.cwiseAbs().maxCoeff();
  if (largest == 0.0) fail("must not be the zero vector; give a direction such as [0, 0, 1]");
  return (value / largest).normalized();  // scaled first: the square of a tiny or huge number is not finite
}

std::vector<YamlValue> YamlValue::items() const {
  if (node_->kind != YamlNode::Kind::list) fail(fmt::format("must be a list, not {}", kind_name(node_->kind)));
  std::vector<YamlValue> values;
  values.reserve(node_->items.size());
  for (const YamlNode& item : node_->items) {
    values.emplace_back(*file_, fmt::format("{}[{}]", path_, values.size()), item, item.mark);
  }
  return values;
}

std::vector<YamlValue::Named> YamlValue::entries() const {
  if (node_->kind != YamlNode::Kind::map) {
    fail(fmt::format("must be a map of keys and values, not {}", kind_name(node_->kind)));
  }
  std::set<std::string_view> seen;
  std::vector<Named> named;
  named.reserve(node_->entries.size());
  for (const YamlNode::Entry& entry : node_->entries) {
    const std::string path = path_of(std::string_view(entry.key).substr(0, kShownWords));
    const YamlValue at_key(*file_, path, entry.value, entry.mark);
    if (!seen.insert(entry.key).second) at_key.fail("stands twice in this map; remove one");
    // The parser places a missing value at whatever comes next; the key is the better place.
    const bool missing = entry.value.kind == YamlNode::Kind::null;
    named.push_back({entry.key, at_key, {*file_, path, entry.value, missing ? entry.mark : entry.value.mark}});
  }
  return named;
}

void Faults::add(std::string_view text) {
  for (const auto part : std::views::split(text, '\n')) {
    std::string line(part.begin(), part.end());
    if (std::ranges::find(lines_, line) == lines_.end()) lines_.push_back(std::move(line));
  }
}

void Faults::raise() const {
  if (lines_.empty()) return;
  const std::size_t shown = std::min(lines_.size(), kMost);
  std::string text = lines_.front();
  for (std::size_t i = 1; i < shown; ++i) text += "\n" + lines_[i];
  if (shown == kMost) text += fmt::format("\nonly the first {} errors are listed; there may be more", kMost);
  throw Error(ExitCode::usage, text);
}

YamlMap::YamlMap(const YamlValue& value, const std::vector<std::string_view>& keys, Faults& faults)
    : whole_(value), entries_(value.entries()) {
  for (const YamlValue::Named& entry : entries_) {
    if (std::find(keys.begin(), keys.end(), entry.key) != keys.end()) continue;
    const std::string_view near = nearest(entry.key, keys);
    if (!near.empty()) misspelt_.emplace_back(near, entry.at_key);
    faults.collect([&] {
      if (near.empty()) entry.at_key.fail(fmt::format("unknown key; known here are {}", joined(keys, ", ")));
      fail_misspelt(entry.at_key, near);
    });
  }
}

YamlMap::YamlMap(const YamlValue& value, const std::vector<std::string_view>& keys) : whole_(value) {
  Faults faults;
  *this = YamlMap(value, keys, faults);
  faults.raise();
}

std::optional<YamlValue> YamlMap::find(std::string_view key) const {
  for (const YamlValue::Named& entry : entries_) {
    if (entry.key == key) return entry.value;
  }
  for (const auto& [meant, at_key] : misspelt_) {
    if (meant == key) fail_misspelt(at_key, meant);
  }
  return std::nullopt;
}

YamlValue YamlMap::at(std::string_view key) const {
  auto value = find(key);
  if (!value) whole_.fail(fmt::format("\"{}\" is missing; add it", key));
  return *value;
}

std::size_t YamlMap::one_of(std::initializer_list<std::string_view> keys) const {
  std::optional<std::size_t> found;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const auto* const key = keys.begin() + i;
    if (!has(*key)) continue;
    if (found) forbid({*key}, fmt::format("\"{}\" is already given", *(keys.begin() + *found)));
    found = i;
  }
  if (!found) whole_.fail(fmt::format("one of {} is missing; add it", joined(keys, ", ")));
  return *found;
}

void YamlMap::forbid(std::initializer_list<std::string_view> keys, std::string_view why) const {
  Faults faults;
  for (const YamlValue::Named& entry : entries_) {
    if (std::find(keys.begin(), keys.end(), entry.key) == keys.end()) continue;
    faults.collect([&] { entry.at_key.fail(fmt::format("must not stand here, {}; remove it", why)); });
  }
  faults.raise();
}

void YamlMap::read(std::string_view key, double& target, const Limits& limits) const {
  if (const auto value = find(key)) target = value->number(limits);
}

void YamlMap::read(std::string_view key, int& target, int least, int most) const {
  if (const auto value = find(key)) target = value->integer(least, most);
}

void YamlMap::read(std::string_view key, bool& target) const {
  if (const auto value = find(key)) target = value->flag();
}

void YamlMap::read(std::string_view key, std::string& target) const {
  if (const auto value = find(key)) target = value->text();
}

}  // namespace subworld
