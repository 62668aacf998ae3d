#include "verdict.hpp"

#include "cdr_text.hpp"

#include "io/json.hpp"

namespace subworld::live {

std::string verdict_schema() {
  return "module subworld {\nmodule msg {\n@final struct Gate {\n  string name;\n  double value;\n  double bound;\n"
         "  boolean at_most;\n  string unit;\n  boolean ok;\n  boolean warning;\n  string missed_by;\n  string "
         "why;\n};\n"
         "@final struct Verdict {\n  string verdict;\n  sequence<Gate> gates;\n};\n};\n};\n";
}

std::vector<std::uint8_t> encode_verdict(const Json& summary) {
  const Json& gates = summary.at("gates");
  CdrText cdr;
  cdr.put_text(summary.at("verdict").get<std::string>());
  cdr.put(static_cast<std::uint32_t>(gates.size()));
  for (const Json& gate : gates) {
    cdr.put_text(gate.at("name").get<std::string>());
    cdr.put(gate.at("value").get<double>());
    cdr.put(gate.at("bound").get<double>());
    cdr.put(gate.at("at_most").get<bool>());
    cdr.put_text(gate.at("unit").get<std::string>());
    cdr.put(gate.at("ok").get<bool>());
    cdr.put(gate.at("warning").get<bool>());
    for (const char* key : {"missed_by", "why"}) cdr.put_text(gate.value(key, std::string()));
  }
  return cdr.take();
}

}  // namespace subworld::live
