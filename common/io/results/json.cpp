#include "io/results/json.hpp"

#include "model/error.hpp"

namespace subworld {

Json parse_json(std::string_view text) {
  try {
    return Json::parse(text);
  } catch (const Json::exception& wrong) {
    throw Error(ExitCode::failed, wrong.what());
  }
}

std::string json_text(const Json& json, int indent) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace subworld
