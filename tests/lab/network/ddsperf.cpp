#include "lab/network/ddsperf.hpp"

#include "io/results/json.hpp"
#include "lab/over_link/run_program.hpp"
#include "link/network.hpp"
#include "model/error.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <future>
#include <sstream>
#include <vector>

namespace subworld {

namespace {

constexpr double kLeastAnswered = 0.9;
constexpr int kMoreSeconds = 2;  // the first, in which the processes find each other, and the last, which is cut

/// One line of figures, in microseconds.
struct Second {
  double p50 = 0.0, p90 = 0.0, p99 = 0.0, max = 0.0;
  int count = 0;
};

std::vector<Second> seconds_in(const std::string& text) {
  std::vector<Second> seconds;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t at = line.find(" mean ");
    Second one;
    if (at != std::string::npos &&
        std::sscanf(line.c_str() + at, " mean %*fus min %*fus 50%% %lfus 90%% %lfus 99%% %lfus max %lfus cnt %d",
                    &one.p50, &one.p90, &one.p99, &one.max, &one.count) == 5)
      seconds.push_back(one);
  }
  return seconds;
}

double median_of(const std::vector<Second>& seconds, double Second::*figure) {
  std::vector<double> values;
  for (const Second& one : seconds) values.push_back(one.*figure);
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

std::string uri_of(const std::string& address, const std::string& peer) {
  return fmt::format(
      "CYCLONEDDS_URI=<CycloneDDS><Domain><General><Interfaces><NetworkInterface address=\"{}\"/></Interfaces>"
      "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
      "<Peers><Peer address=\"{}\"/></Peers></Discovery></Domain></CycloneDDS>",
      address, peer);
}

}  // namespace

void require_ddsperf() {
  constexpr int kNotFound = 127;  // as from a shell
  if (run_program({kDdsperf, "help"}, nullptr).code == kNotFound)
    throw Error(ExitCode::failed, "--baseline ddsperf: the program is missing; apt-get install cyclonedds-tools");
}

Json ddsperf_figures(const std::string& text, double rate_hz) {
  std::vector<Second> seconds = seconds_in(text);
  if (!seconds.empty()) seconds.erase(seconds.begin());
  int count = 0;
  for (const Second& one : seconds) count += one.count;
  Json figures{{"p50", nullptr}, {"p90", nullptr}, {"p99", nullptr}, {"max", nullptr}, {"n", count}};
  if (seconds.empty() || count < kLeastAnswered * rate_hz * static_cast<double>(seconds.size())) return figures;
  constexpr double kRoundTrip_s = 2e-6;  // of half a round trip in microseconds
  figures["p50"] = kRoundTrip_s * median_of(seconds, &Second::p50);
  figures["p90"] = kRoundTrip_s * median_of(seconds, &Second::p90);
  figures["p99"] = kRoundTrip_s * median_of(seconds, &Second::p99);
  figures["max"] = kRoundTrip_s * std::ranges::max_element(seconds, {}, &Second::max)->max;
  return figures;
}

Json measure_ddsperf(const NetworkCell& cell, const NetworkRunSettings& settings) {
  if (cell.users != 1) return ddsperf_figures("", cell.rate_hz);
  const std::unique_ptr<EmulatedNetwork> network = network_of(cell, settings.seed);
  const auto run = [&](int host, std::vector<std::string> mode) {
    const std::string mine = network ? network->address(host) : "127.0.0.1";
    std::vector<std::string> words{"env",
                                   uri_of(mine, network ? network->address(1 - host) : mine),
                                   kDdsperf,
                                   "-i",
                                   std::to_string(settings.domain),
                                   "-D",
                                   std::to_string(static_cast<int>(std::ceil(settings.duration_s)) + kMoreSeconds)};
    if (!cell.reliable) words.emplace_back("-u");
    words.insert(words.end(), mode.begin(), mode.end());
    return run_program(words, network ? &network->host(host) : nullptr).text;
  };
  std::future<std::string> pong = std::async(std::launch::async, [&] { return run(1, {"pong"}); });
  const std::string text =
      run(0, {"ping", fmt::format("{:g}Hz", cell.rate_hz), "size", std::to_string(cell.payload_bytes)});
  pong.wait();
  return ddsperf_figures(text, cell.rate_hz);
}

}  // namespace subworld
