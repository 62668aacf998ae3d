#pragma once

#include "io/results.hpp"

#include <nlohmann/json.hpp>

#include <optional>

// For sources that read or write members of a `Json`. Headers need io/results.hpp only: compiling the library takes
// long.

namespace subworld {

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
