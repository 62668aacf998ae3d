// An engine's code that accesses addresses outside its memory: an error, and the program continues.
#include "model/error.hpp"
#include "physics/wasm/host.hpp"

#include <gtest/gtest.h>

#include <csignal>
#include <functional>
#include <string>
#include <thread>

namespace subworld {
namespace {

constexpr std::uint64_t kPage = 65536;

/// As the converted code reads and writes: an address and an offset of 32 bits, without a check.
__attribute__((noinline)) std::uint8_t read(const wasm_rt_memory_t& memory, std::uint32_t address,
                                            std::uint32_t offset) {
  return *(static_cast<volatile std::uint8_t*>(memory.data) + (std::uint64_t{address} + offset));
}
__attribute__((noinline)) void write(const wasm_rt_memory_t& memory, std::uint64_t at) {
  *(static_cast<volatile std::uint8_t*>(memory.data) + at) = 1;
}

class WasmMemory : public ::testing::Test {
 protected:
  WasmMemory() { wasm_rt_allocate_memory(&memory_, 1, 3, false, kPage); }
  ~WasmMemory() override { wasm_rt_free_memory(&memory_); }
  void expect_outside(const std::function<void()>& access) const {
    try {
      access();
      ADD_FAILURE() << "it was allowed";
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("outside of its memory"), std::string::npos) << error.what();
    }
  }
  wasm_rt_memory_t memory_;
};

TEST_F(WasmMemory, IsThereAsFarAsItWasAllocated) {
  write(memory_, kPage - 1);
  EXPECT_EQ(read(memory_, kPage - 2, 1), 1);
  EXPECT_EQ(wasm_rt_grow_memory(&memory_, 1), 1U);
  EXPECT_EQ(read(memory_, kPage, 0), 0);
}

TEST_F(WasmMemory, ThatIsFreedCanBeHadAgain) {
  for (int i = 0; i < 3000; ++i) {
    wasm_rt_memory_t one;
    ASSERT_NO_THROW(wasm_rt_allocate_memory(&one, 1, 2, false, kPage)) << i;
    wasm_rt_free_memory(&one);
  }
}

#if WASM_RT_MEMCHECK_GUARD_PAGES

TEST_F(WasmMemory, OutsideOfItAnAccessIsAnError) {
  for (int round = 0; round < 3; ++round) {
    expect_outside([&] { read(memory_, kPage, 0); });
    expect_outside([&] { write(memory_, 2 * kPage); });
    expect_outside([&] { read(memory_, 0xffffffff, 0); });
    expect_outside([&] { read(memory_, 0xffffffff, 0xffffffff); });
  }
  EXPECT_EQ(read(memory_, 0, 0), 0) << "the program continues";
}

TEST_F(WasmMemory, AnErrorBelongsToItsThread) {
  std::thread([&] { expect_outside([&] { read(memory_, kPage, 1); }); }).join();
}

TEST_F(WasmMemory, OtherFaultsAreWhatTheyWere) {
  std::uint8_t* volatile nowhere = nullptr;
  EXPECT_EXIT(*nowhere = 1, ::testing::KilledBySignal(SIGSEGV), "");
}

#endif

}  // namespace
}  // namespace subworld
