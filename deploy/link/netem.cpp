#include "link/network.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"

#include <fmt/core.h>

#include <array>
#include <cstdio>
#include <utility>

namespace subworld {

namespace {

using NetemHosts = std::array<const NetworkHost*, 2>;

/// `tc` and `ip` count in these units.
std::string netem_time(double s) { return fmt::format("{:.0f}ns", 1e9 * s); }
std::string netem_ratio(double ratio) { return fmt::format("{:.7f}%", 100.0 * ratio); }

void must_run(const std::vector<std::string>& words, const NetworkHost& host, const std::string& cure) {
  Finished ended = run_program(words, &host);
  while (ended.text.ends_with('\n')) ended.text.pop_back();
  if (ended.code == 0) return;
  throw Error(ExitCode::failed, fmt::format("link: `{}`: {}; {}", joined(words, " "),
                                            ended.code == 127 ? "not installed" : ended.text, cure));
}

/// Two ends of a virtual cable with netem at each. The cable goes with its namespaces.
class NetemCable : public LinkCarrier {
 public:
  NetemCable(NetemHosts hosts, const std::vector<std::string>& addresses, const std::vector<LinkSettings>& links,
             int mtu)
      : hosts_(hosts) {
    constexpr const char* kCable = "install iproute2 and a kernel with veth, or use --backend tun";
    const std::string device = EmulatedNetwork::kInterface, bytes = std::to_string(mtu);
    must_run({"ip", "link", "add", device, "mtu", bytes, "type", "veth", "peer", "name", device, "mtu", bytes, "netns",
              hosts[1]->path()},
             *hosts[0], kCable);
    for (std::size_t i = 0; i < 2; ++i) {
      must_run({"ip", "address", "add", addresses[i] + "/24", "dev", device}, *hosts[i], kCable);
      must_run({"ip", "link", "set", device, "up"}, *hosts[i], kCable);
      apply("add", i, links[i == 0 ? 1 : 2]);
    }
  }
  /// Without the cable, so that other devices can have its name.
  static void remove(const NetworkHost& host) {
    [[maybe_unused]] const Finished ended = run_program({"ip", "link", "delete", EmulatedNetwork::kInterface}, &host);
  }

  void set(LinkEnds ends, const LinkSettings& settings) override { apply("change", ends.from, settings); }
  LinkCounters counters(LinkEnds ends) override {
    const Finished shown =
        run_program({"tc", "-s", "qdisc", "show", "dev", EmulatedNetwork::kInterface}, hosts_[ends.from]);
    LinkCounters counters;
    unsigned long long bytes = 0, packets = 0, dropped = 0;
    const std::size_t at = shown.text.find("Sent ");
    if (at != std::string::npos && std::sscanf(shown.text.c_str() + at, "Sent %llu bytes %llu pkt (dropped %llu",
                                               &bytes, &packets, &dropped) == 3) {
      counters = {.packets = packets + dropped, .bytes = bytes, .delivered = packets, .lost = dropped};
    }
    return counters;
  }
  double cpu_s() override { return 0.0; }
  std::string description() const override { return "netem"; }

 private:
  void apply(const char* verb, std::size_t from, const LinkSettings& settings) {
    std::vector<std::string> words{"tc", "qdisc", verb, "dev", EmulatedNetwork::kInterface, "root", "netem"};
    for (std::string& word : netem_words(settings)) words.push_back(std::move(word));
    must_run(words, *hosts_[from], "this kernel has no netem (module sch_netem); use --backend tun");
  }
  NetemHosts hosts_;
};

}  // namespace

std::vector<std::string> netem_words(const LinkSettings& settings) {
  if (settings.outage.for_s > 0.0) throw Error(ExitCode::usage, "link: netem has no outage; use --backend tun");
  std::vector<std::string> words{"limit", std::to_string(settings.limit)};
  const auto add = [&](std::initializer_list<std::string> more) { words.insert(words.end(), more); };
  if (settings.delay_s > 0.0 || settings.jitter_s > 0.0) add({"delay", netem_time(settings.delay_s)});
  if (settings.jitter_s > 0.0) add({netem_time(settings.jitter_s)});
  if (settings.jitter_s > 0.0 && settings.shape != JitterShape::uniform)
    add({"distribution", settings.shape == JitterShape::normal ? "normal" : "pareto"});
  const LossModel& loss = settings.loss;
  if (loss.p > 0.0) {
    add({"loss", "gemodel", netem_ratio(loss.p), netem_ratio(loss.r), netem_ratio(loss.loss_in_bad),
         netem_ratio(loss.loss_in_good)});
  } else if (loss.loss_in_good > 0.0) {
    add({"loss", "random", netem_ratio(loss.loss_in_good)});
  }
  if (settings.duplicate_ratio > 0.0) add({"duplicate", netem_ratio(settings.duplicate_ratio)});
  if (settings.reorder_ratio > 0.0)
    add({"reorder", netem_ratio(settings.reorder_ratio), "gap", std::to_string(settings.reorder_gap)});
  // The rate counts IP packets: without the 14 bytes of the Ethernet header.
  if (settings.rate_bit_s > 0.0) add({"rate", fmt::format("{:.0f}bit", settings.rate_bit_s), "-14"});
  return words;
}

std::unique_ptr<LinkCarrier> netem_carrier(const NetworkHost& a, const NetworkHost& b,
                                           const std::vector<std::string>& addresses,
                                           const std::vector<LinkSettings>& links, int mtu) {
  try {
    return std::make_unique<NetemCable>(NetemHosts{&a, &b}, addresses, links, mtu);
  } catch (const Error&) {
    NetemCable::remove(a);
    throw;
  }
}

}  // namespace subworld
