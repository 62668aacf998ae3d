#pragma once

#include "io/results.hpp"

#include <cstdint>
#include <string>
#include <vector>

namespace subworld::live {

/// The schema of `subworld::msg::Verdict`.
[[nodiscard]] std::string verdict_schema();
/// A `Verdict`, as CDR, of the summary of a run. Throws `std::exception` where that has no verdict.
[[nodiscard]] std::vector<std::uint8_t> encode_verdict(const Json& summary);

}  // namespace subworld::live
