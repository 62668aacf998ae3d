#include "lab/network/peer.hpp"

#include "lab/network/udp.hpp"
#include "model/error.hpp"
#include "rt/cyclic.hpp"
#include "rt/scheduling.hpp"
#include "wire/plugin.hpp"

#include <fmt/core.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <condition_variable>
#include <csignal>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

namespace subworld {

namespace {

constexpr std::size_t kEncapsulation_bytes = 4;
constexpr double kMostLate_s = 0.1;  // of the last message, where the machine is busy
constexpr auto kPoll = std::chrono::milliseconds(5);

/// Contents of a message, after its encapsulation.
struct PingStamp {
  std::uint64_t number = 0;
  std::int64_t sent_ns = 0;
  std::int64_t returned_ns = 0;
};
static_assert(kEncapsulation_bytes + sizeof(PingStamp) <= kLeastPayload_bytes);

std::optional<PingStamp> stamp_in(const std::vector<std::uint8_t>& bytes) {
  PingStamp stamp;
  if (bytes.size() < kEncapsulation_bytes + sizeof stamp) return std::nullopt;
  std::memcpy(&stamp, bytes.data() + kEncapsulation_bytes, sizeof stamp);
  return stamp;
}
void put(std::vector<std::uint8_t>& bytes, const PingStamp& stamp) {
  std::memcpy(bytes.data() + kEncapsulation_bytes, &stamp, sizeof stamp);
}

double process_cpu_s() {
  rusage used{};
  getrusage(RUSAGE_SELF, &used);
  const auto s = [](const timeval& t) { return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec); };
  return s(used.ru_utime) + s(used.ru_stime);
}

double seconds_between(std::int64_t from_ns, std::int64_t to_ns) { return 1e-9 * static_cast<double>(to_ns - from_ns); }

class PeerSink final : public wire::EventSink {
 public:
  PeerSink(const CellShared& shared, PeerShared& mine) : shared_(shared), mine_(mine) {}
  void report(wire::Event event, std::uint64_t count, const char*, const char*, const char*) noexcept override {
    // While the last messages arrive nothing is sent: deadlines pass then.
    if (shared_.phase == CellPhase::measuring) mine_.events[static_cast<std::size_t>(event)] += count;
    wake();
  }
  void wake() noexcept override {
    {
      const std::lock_guard lock(mutex_);
      ++changes_;
    }
    changed_.notify_one();
  }
  void wait() noexcept {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, kPoll, [this] { return changes_ != seen_; });
    seen_ = changes_;
  }

 private:
  const CellShared& shared_;
  PeerShared& mine_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t changes_ = 0, seen_ = 0;
};

/// Notes the CPU time between the begin and the end of the measurement.
class CpuShare {
 public:
  explicit CpuShare(PeerShared& into) : into_(into) {}
  void begin() {
    begin_cpu_s_ = process_cpu_s();
    begin_ = Clock::now();
  }
  void end() {
    into_.cpu_s = process_cpu_s() - begin_cpu_s_;
    into_.measured_s = to_seconds(Clock::now() - begin_);
  }
  void follow(CellPhase phase) {
    if (phase == seen_) return;
    if (phase >= CellPhase::measuring && seen_ < CellPhase::measuring) begin();
    if (phase >= CellPhase::draining && seen_ < CellPhase::draining) end();
    seen_ = phase;
  }

 private:
  PeerShared& into_;
  CellPhase seen_ = CellPhase::matching;
  double begin_cpu_s_ = 0.0;
  TimePoint begin_{};
};

/// One side of the messages to a user and back.
struct Channel {
  std::unique_ptr<wire::BackendWriter> writer;
  std::unique_ptr<wire::BackendReader> reader;
};

class Peer {
 public:
  Peer(const PeerPlan& plan, int number, CellShared& shared)
      : plan_(plan), number_(number), shared_(shared), mine_(shared.peers[number]), sink_(shared, mine_) {
    claim_realtime(priority::kMiddleware);  // the middleware's threads inherit it
    open(number == 0 ? plan.cell.world_dds : plan.cell.haptic_dds);
    const int first = number == 0 ? 0 : number - 1, users = number == 0 ? plan.cell.users : 1;
    for (int user = first; user < first + users; ++user) channels_.push_back(channel_of(user));
  }

  void run() {
    await_match();
    if (number_ == 0)
      run_world();
    else
      run_user();
    mine_.reported = true;
  }

 private:
  void open(const std::string& vendor) {
    if (vendor == kPlainUdp) {
      std::unique_ptr<UdpBackend> udp = open_udp(plan_, number_, sink_);
      wait_ = [datagrams = udp.get()] { datagrams->wait(); };
      backend_ = std::move(udp);
      return;
    }
    BusConfig config;
    config.vendor = parse_vendor(vendor);
    config.domain = plan_.domain;
    config.mode = Mode::realtime;
    config.interface_address = plan_.interface_address;
    config.peers = plan_.peers;
    config.participants = plan_.cell.users + 2;
    config.participant_name = number_ == 0 ? "lab_world" : fmt::format("lab_user_{}", number_ - 1);
    backend_.reset(wire::load_plugin(config.vendor)(wire::prepare(config), sink_));
    wait_ = [this] { sink_.wait(); };
  }

  [[nodiscard]] Channel channel_of(int user) {
    const auto spec = [&](const char* topic) {
      return wire::EndpointSpec{{.name = topic,
                                 .type = "subworld::lab::Message",
                                 .key_words = 0,
                                 .reliability = Reliability::best_effort,
                                 .durability = Durability::volatile_,
                                 .depth = plan_.cell.depth,
                                 .deadline = DeadlineKind::none},
                                qos_of(plan_.cell),
                                fmt::format("user_{}", user)};
    };
    Channel channel;
    channel.writer = backend_->create_writer(spec(number_ == 0 ? "lab_there" : "lab_back"));
    channel.reader = backend_->create_reader(spec(number_ == 0 ? "lab_back" : "lab_there"));
    return channel;
  }

  void await_match() {
    const auto matched = [](const Channel& one) { return one.writer->matched() > 0 && one.reader->matched() > 0; };
    while (shared_.phase == CellPhase::matching) {
      if (!mine_.matched && std::ranges::all_of(channels_, matched)) mine_.matched = true;
      wait_();
    }
  }

  void run_user() {
    note_scheduling(claim_realtime(priority::kHaptic));
    ChannelShared& figures = shared_.channels[number_ - 1];
    ArrivalBook book(figures.there, plan_.first(), plan_.most());
    Channel& channel = channels_.front();
    CpuShare cpu(mine_);
    std::vector<std::uint8_t> bytes;
    std::uint64_t writer = 0;
    for (CellPhase phase = shared_.phase; phase != CellPhase::ending; phase = shared_.phase) {
      cpu.follow(phase);
      while (channel.reader->take(bytes, writer)) {
        std::optional<PingStamp> stamp = stamp_in(bytes);
        if (!stamp) continue;
        stamp->returned_ns = to_ns(Clock::now());
        put(bytes, *stamp);
        const bool written = channel.writer->write(bytes);
        if (book.add(stamp->number, stamp->returned_ns, seconds_between(stamp->sent_ns, stamp->returned_ns)) &&
            !written)
          ++figures.refused;
      }
      wait_();
    }
    cpu.follow(CellPhase::ending);
    book.close(shared_.sent, shared_.begin_ns, shared_.end_ns);
  }

  void run_world() {
    std::vector<ArrivalBook> books;
    for (int user = 0; user < plan_.cell.users; ++user)
      books.emplace_back(shared_.channels[user].round_trip, plan_.first(), plan_.most());
    std::thread receiver([&] { receive_returned(books); });
    send_all();
    receiver.join();
    for (ArrivalBook& book : books) book.close(shared_.sent, shared_.begin_ns, shared_.end_ns);
  }

  void receive_returned(std::vector<ArrivalBook>& books) {
    claim_realtime(priority::kHaptic);
    std::vector<std::uint8_t> bytes;
    std::uint64_t writer = 0;
    while (shared_.phase != CellPhase::ending) {
      for (std::size_t user = 0; user < channels_.size(); ++user) {
        while (channels_[user].reader->take(bytes, writer)) {
          const std::int64_t now_ns = to_ns(Clock::now());
          const std::optional<PingStamp> stamp = stamp_in(bytes);
          if (stamp && books[user].add(stamp->number, now_ns, seconds_between(stamp->sent_ns, now_ns)))
            shared_.channels[user].back.add(seconds_between(stamp->returned_ns, now_ns));
        }
      }
      wait_();
    }
  }

  /// A sender that cannot keep the rate sends fewer messages in the same time.
  void send_all() {
    note_scheduling(claim_realtime(priority::kWorld));
    std::vector<std::uint8_t> bytes(plan_.cell.payload_bytes, 0);
    bytes[1] = 1;  // little-endian CDR
    CpuShare cpu(mine_);
    const std::uint64_t first = plan_.first(), most = plan_.most();
    const TimePoint start = Clock::now();
    const TimePoint until = start + from_seconds(kStartUp_s + plan_.duration_s + kMostLate_s);
    Cyclic cycle(start, from_seconds(1.0 / plan_.cell.rate_hz));
    for (std::uint64_t number = 0; number < most && shared_.phase != CellPhase::ending; ++number) {
      cycle.wait();
      if (number > first && Clock::now() > until) break;
      if (number == first) {
        shared_.begin_ns = to_ns(Clock::now());
        shared_.phase = CellPhase::measuring;
        cpu.begin();
      }
      for (std::size_t user = 0; user < channels_.size(); ++user) {
        put(bytes, PingStamp{.number = number, .sent_ns = to_ns(Clock::now())});
        if (!channels_[user].writer->write(bytes) && number >= first) ++shared_.channels[user].refused;
      }
      shared_.sent = number + 1;
    }
    cpu.end();
    shared_.end_ns = to_ns(Clock::now());
    CellPhase measuring = CellPhase::measuring;
    shared_.phase.compare_exchange_strong(measuring, CellPhase::draining);
  }

  void note_scheduling(const Scheduling& granted) {
    granted.text.copy(mine_.scheduling.data(), mine_.scheduling.size() - 1);
  }

  const PeerPlan& plan_;
  int number_;
  CellShared& shared_;
  PeerShared& mine_;
  PeerSink sink_;
  std::unique_ptr<wire::Backend> backend_;
  std::function<void()> wait_;  ///< for a message, at most a few milliseconds
  std::vector<Channel> channels_;
};

void run_peer(const PeerPlan& plan, int number, CellShared& shared) {
  try {
    if (plan.host != nullptr && !plan.host->enter())
      throw Error(ExitCode::failed, fmt::format("network namespace: {}", std::strerror(errno)));
    Peer(plan, number, shared).run();
  } catch (const std::exception& e) {
    std::string(e.what()).copy(shared.peers[number].failure.data(), shared.peers[number].failure.size() - 1);
  }
}

}  // namespace

std::uint64_t PeerPlan::first() const { return static_cast<std::uint64_t>(std::ceil(kStartUp_s * cell.rate_hz)); }

std::uint64_t PeerPlan::most() const {
  return first() + std::max<std::uint64_t>(1, static_cast<std::uint64_t>(std::llround(duration_s * cell.rate_hz)));
}

pid_t start_peer(const PeerPlan& plan, int number, CellShared& shared) {
  std::fflush(nullptr);
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child < 0) throw Error(ExitCode::failed, fmt::format("lab network: no process: {}", std::strerror(errno)));
  if (child > 0) return child;
  setpgid(0, 0);
  for (const int signal_number : {SIGINT, SIGTERM, SIGHUP}) signal(signal_number, SIG_DFL);
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(1);
  run_peer(plan, number, shared);
  _exit(0);  // objects of the parent, such as the emulated network, are not this process's to end
}

}  // namespace subworld
