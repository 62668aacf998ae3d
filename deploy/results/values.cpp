#include "results/values.hpp"

#include "io/json.hpp"

#include <cstdlib>
#include <limits>
#include <sstream>

namespace subworld {

const Json& value_at(const Json& json, const std::string& path) {
  static const Json kNone;
  const Json* at = &json;
  std::istringstream keys(path);
  for (std::string key; std::getline(keys, key, '/');) {
    if (at->is_object() && at->contains(key)) {
      at = &(*at)[key];
      continue;
    }
    const bool is_number = !key.empty() && key.find_first_not_of("0123456789") == std::string::npos;
    const std::size_t place = is_number ? std::strtoul(key.c_str(), nullptr, 10) : 0;
    if (!is_number || !at->is_array() || place >= at->size()) return kNone;
    at = &(*at)[place];
  }
  return *at;
}

double number_at(const Json& json, const std::string& path) {
  const Json& value = value_at(json, path);
  return value.is_number() ? value.get<double>() : std::numeric_limits<double>::quiet_NaN();
}

std::string text_at(const Json& json, const std::string& path) {
  const Json& value = value_at(json, path);
  if (value.is_null()) return "";
  if (value.is_string()) return value.get<std::string>();
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace subworld
