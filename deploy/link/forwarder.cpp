#include "link/forwarder.hpp"

#include "model/error.hpp"
#include "rt/cyclic.hpp"

#include <fmt/core.h>
#include <poll.h>
#include <sched.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>

namespace subworld {

namespace {

constexpr int kPriority = 90;              // above the loops that the network serves; its steps take microseconds
constexpr int kBatch = 16;                 // packets that are read before departures are served again
constexpr std::size_t kMostSlots = 16384;  // 24 MB; more only where one link asks for more
constexpr std::size_t kMostHosts = 254;

std::uint32_t destination_of(const std::uint8_t* packet) noexcept {
  return std::uint32_t{packet[16]} << 24 | std::uint32_t{packet[17]} << 16 | std::uint32_t{packet[18]} << 8 |
         packet[19];
}

/// A seed for each link, far from those of its neighbours (the finaliser of SplitMix64).
std::uint64_t link_seed(std::uint64_t seed, std::uint64_t link) noexcept {
  std::uint64_t x = seed + 0x9e3779b97f4a7c15U * (link + 1);
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31);
}

/// The heap's order: the latest departure is the least.
constexpr auto kLater = [](const auto& a, const auto& b) {
  return a.departure_ns != b.departure_ns ? a.departure_ns > b.departure_ns : a.number > b.number;
};

}  // namespace

Forwarder::Forwarder(std::vector<Host> hosts, const std::vector<LinkSettings>& links, int mtu, std::uint64_t seed)
    : hosts_(std::move(hosts)), counters_(links.size()), mtu_(mtu) {
  std::size_t all = 0, largest = 0;
  for (std::size_t i = 0; i < links.size(); ++i) {
    links_.emplace_back(links[i], link_seed(seed, i));
    all += links[i].limit;
    largest = std::max<std::size_t>(largest, links[i].limit);
  }
  // One more: the slot into which the next packet is read.
  const std::size_t slots = 1 + std::min(all, std::max(kMostSlots, largest));
  pool_.resize(slots * mtu_);
  sizes_.resize(slots);
  uses_.resize(slots);
  for (std::size_t slot = slots; slot-- > 0;) free_.push_back(static_cast<std::uint32_t>(slot));
  waiting_.reserve(2 * slots);
  start_ns_ = to_ns(Clock::now());
  wake_ = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (wake_ < 0) throw Error(ExitCode::failed, fmt::format("link: eventfd: {}", std::strerror(errno)));
  thread_ = std::thread([this] { run(); });
  sched_param parameter{};
  parameter.sched_priority = kPriority;
  const int error = pthread_setschedparam(thread_.native_handle(), SCHED_FIFO, &parameter);
  scheduling_ = error == 0 ? fmt::format("SCHED_FIFO {}", kPriority)
                           : fmt::format("default scheduling: packets leave late under load ({}; cure: run as root)",
                                         std::strerror(error));
}

Forwarder::~Forwarder() {
  in_thread([&] { stop_ = true; });
  thread_.join();
  close(wake_);
}

void Forwarder::in_thread(const std::function<void()>& act) {
  act_ = &act;
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto written = write(wake_, &one, sizeof one);
  acted_.acquire();
}

void Forwarder::set(LinkEnds ends, const LinkSettings& settings) {
  in_thread([&] { links_[index(ends)].set(settings); });
}

LinkCounters Forwarder::counters(LinkEnds ends) {
  LinkCounters found;
  in_thread([&] { found = counters_[index(ends)]; });
  return found;
}

double Forwarder::cpu_s() {
  timespec used{};
  in_thread([&] { clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used); });
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

std::int64_t Forwarder::now_ns() const noexcept { return to_ns(Clock::now()) - start_ns_; }

void Forwarder::run() {
  prctl(PR_SET_TIMERSLACK, 1UL);
  while (!stop_) {
    if (const std::function<void()>* act = act_.exchange(nullptr)) {
      (*act)();
      acted_.release();
    }
    send_due();
    bool read = false;
    for (std::size_t host = 0; host < hosts_.size(); ++host) read = receive(host) || read;
    if (!read) wait();
  }
}

void Forwarder::release(std::uint32_t slot) noexcept {
  if (--uses_[slot] == 0) free_.push_back(slot);
}

void Forwarder::send_due() {
  for (int sent = 0; sent < kBatch && !waiting_.empty() && waiting_.front().departure_ns <= now_ns(); ++sent) {
    std::pop_heap(waiting_.begin(), waiting_.end(), kLater);
    const Waiting packet = waiting_.back();
    waiting_.pop_back();
    const Host& to = hosts_[packet.link % hosts_.size()];
    const int bytes = sizes_[packet.slot];
    const bool taken = write(to.tun, &pool_[std::size_t{packet.slot} * mtu_], bytes) == bytes;
    const std::int64_t done_ns = now_ns();
    LinkCounters& counters = counters_[packet.link];
    ++(taken ? counters.delivered : counters.refused);
    counters.delay.add(1e-9 * static_cast<double>(done_ns - packet.arrival_ns));
    counters.lateness.add(1e-9 * static_cast<double>(done_ns - packet.departure_ns));
    links_[packet.link].leave();
    release(packet.slot);
  }
}

/// Reads up to a batch of packets that a host has sent; false where there was none.
bool Forwarder::receive(std::size_t host) {
  for (int count = 0; count < kBatch; ++count) {
    // One slot is never handed out: a packet without room is read into it and dropped.
    const bool room = free_.size() > 1;
    const std::uint32_t slot = free_.back();
    const ssize_t bytes = read(hosts_[host].tun, &pool_[std::size_t{slot} * mtu_], mtu_);
    if (bytes <= 0) return count > 0;
    const std::int64_t now = now_ns();
    const bool ipv4 = bytes >= 20 && pool_[std::size_t{slot} * mtu_] >> 4 == 4;
    if (!ipv4) continue;
    if (!room) {
      const std::uint32_t to = destination_of(&pool_[std::size_t{slot} * mtu_]);
      for (std::size_t other = 0; other < hosts_.size(); ++other) {
        if (hosts_[other].address != to) continue;
        LinkCounters& counters = counters_[host * hosts_.size() + other];
        ++counters.packets;
        counters.bytes += bytes;
        ++counters.queue_full;
      }
      continue;
    }
    free_.pop_back();
    uses_[slot] = 1;
    sizes_[slot] = static_cast<int>(bytes);
    route(host, slot, static_cast<int>(bytes), now);
    release(slot);
  }
  return true;
}

void Forwarder::route(std::size_t host, std::uint32_t slot, int bytes, std::int64_t now) {
  const std::uint32_t to = destination_of(&pool_[std::size_t{slot} * mtu_]);
  const bool to_all = to >> 28 == 14 || to == 0xffffffffU || (to & 0xffU) == 0xffU;
  for (std::size_t other = 0; other < hosts_.size(); ++other) {
    if (other != host && (to_all || hosts_[other].address == to)) pass(host * hosts_.size() + other, slot, bytes, now);
  }
}

void Forwarder::pass(std::size_t link, std::uint32_t slot, int bytes, std::int64_t now) {
  LinkCounters& counters = counters_[link];
  ++counters.packets;
  counters.bytes += bytes;
  const PacketFate fate = links_[link].arrive(now, bytes);
  counters.lost += fate.drop == LinkDrop::loss ? 1 : 0;
  counters.in_outage += fate.drop == LinkDrop::outage ? 1 : 0;
  counters.queue_full += fate.drop == LinkDrop::queue ? 1 : 0;
  counters.duplicated += fate.copies == 2 ? 1 : 0;
  for (int i = 0; i < fate.copies; ++i) {
    if (waiting_.size() == waiting_.capacity()) {
      ++counters.queue_full;
      links_[link].leave();
      continue;
    }
    ++uses_[slot];
    waiting_.push_back({fate.departure_ns[i], arrivals_++, now, slot, static_cast<std::uint32_t>(link)});
    std::push_heap(waiting_.begin(), waiting_.end(), kLater);
  }
}

/// Sleeps until a packet arrives, another thread asks for something or the next packet is due.
void Forwarder::wait() {
  std::array<pollfd, kMostHosts + 1> polled;
  for (std::size_t i = 0; i < hosts_.size(); ++i) polled[i] = {hosts_[i].tun, POLLIN, 0};
  polled[hosts_.size()] = {wake_, POLLIN, 0};
  timespec left{1, 0};
  if (!waiting_.empty()) {
    const std::int64_t ns = std::clamp<std::int64_t>(waiting_.front().departure_ns - now_ns(), 0, 1'000'000'000);
    left = {static_cast<time_t>(ns / 1'000'000'000), static_cast<long>(ns % 1'000'000'000)};
  }
  ppoll(polled.data(), hosts_.size() + 1, &left, nullptr);
  if ((polled[hosts_.size()].revents & POLLIN) != 0) {
    std::uint64_t count = 0;
    [[maybe_unused]] const auto read_bytes = read(wake_, &count, sizeof count);
  }
}

}  // namespace subworld
