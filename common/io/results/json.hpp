#pragma once

#include "io/results/results.hpp"

#include <nlohmann/json.hpp>

#include <optional>
#include <string>
#include <string_view>

// For sources that read or write members of a `Json`. Headers need io/results/results.hpp only: compiling the library
// takes long.

namespace subworld {

// No other source parses or writes JSON: the library's code for it is large, and made anew in each unit that uses it.
/// Throws `Error` (failed) with the line and the column of a fault.
[[nodiscard]] Json parse_json(std::string_view text);
/// In one line; with an indent of 0 or more, in several. A text need not be UTF-8, which JSON is.
[[nodiscard]] std::string json_text(const Json& json, int indent = -1);

template <class T>
void put(Json& json, const char* key, const T& value) {
  json[key] = value;
}
template <class T>
void put(Json& json, const char* key, const std::optional<T>& value) {
  if (value) json[key] = *value;
}
template <class T>
void get(const Json& json, const char* key, T& value) {
  json.at(key).get_to(value);
}
template <class T>
void get(const Json& json, const char* key, std::optional<T>& value) {
  if (json.contains(key)) json[key].get_to(value.emplace());
}
#define SUBWORLD_PUT(member) put(json, #member, from.member);
#define SUBWORLD_GET(member) get(json, #member, to.member);
/// The conversion of a struct to JSON and back: a key for each of these members, in this order. An empty optional has
/// no key. Where a header has the struct, it declares both by SUBWORLD_HAS_JSON.
#define SUBWORLD_JSON(Type, ...)                                                                                      \
  void to_json(Json& json, const Type& from) { NLOHMANN_JSON_EXPAND(NLOHMANN_JSON_PASTE(SUBWORLD_PUT, __VA_ARGS__)) } \
  void from_json(const Json& json, Type& to) { NLOHMANN_JSON_EXPAND(NLOHMANN_JSON_PASTE(SUBWORLD_GET, __VA_ARGS__)) }

}  // namespace subworld
