#include "mpi_ranks.h"

#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <nlohmann/json.hpp>
#include <string_view>
#include <thread>

#include "command.h"
#include "tileflight/core/base/input_error.h"

#ifdef TILEFLIGHT_MPI
#define OMPI_SKIP_MPICXX 1
#include <mpi.h>
#include <signal.h>

#include <atomic>
#include <mutex>
#endif

namespace tileflight::app {
namespace {

/// A count that mpirun (Open MPI) passes to the processes it starts; 0: it did not start this one.
int told_by_mpirun(const char* variable) {
  const char* text = std::getenv(variable);
  if (text == nullptr) return 0;
  const std::string_view view(text);
  int value = 0;
  const auto [end, fault] = std::from_chars(view.data(), view.data() + view.size(), value);
  return fault == std::errc() && end == view.data() + view.size() ? value : 0;
}

bool is_started_by_mpirun() { return told_by_mpirun("OMPI_COMM_WORLD_SIZE") > 0; }

#ifdef TILEFLIGHT_MPI
using std::chrono::milliseconds;

sigset_t only_sigterm() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGTERM);
  return set;
}

/// Handles SIGTERM, which mpirun sends to the other processes when one dies. The signal is blocked in every thread
/// started from now on, and received by a dedicated thread.
class EndWatch {
 public:
  EndWatch() {
    const sigset_t set = only_sigterm();
    pthread_sigmask(SIG_BLOCK, &set, nullptr);
    thread_ = std::thread([this] { watch(); });
  }
  ~EndWatch() {
    done_ = true;
    thread_.join();
  }
  EndWatch(const EndWatch&) = delete;
  EndWatch& operator=(const EndWatch&) = delete;

  void set_last_words(std::function<std::string()> last_words) {
    const std::lock_guard lock(mutex_);
    last_words_ = std::move(last_words);
  }

 private:
  void watch() {
    const sigset_t set = only_sigterm();
    const timespec pause{0, 50'000'000};
    while (!done_) {
      if (sigtimedwait(&set, nullptr, &pause) == SIGTERM) end();
    }
  }
  [[noreturn]] void end() {
    const std::lock_guard lock(mutex_);
    const std::string words = last_words_ ? last_words_() : "";
    if (!words.empty()) std::cerr << "tileflight: " + words + "\n" << std::flush;
    // Other ranks check whether this process is alive to decide which one reports.
    std::this_thread::sleep_for(milliseconds(300));
    std::_Exit(1);
  }

  std::atomic<bool> done_{false};
  std::mutex mutex_;
  std::function<std::string()> last_words_;
  std::thread thread_;
};

class MpiRanks : public jobs::Ranks {
 public:
  MpiRanks() {
    int level = 0;
    MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &level);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &count_);
  }
  ~MpiRanks() override { MPI_Finalize(); }

  int rank() const override { return rank_; }
  int count() const override { return count_; }
  void set_termination_message(std::function<std::string()> last_words) override {
    end_watch_.set_last_words(std::move(last_words));
  }

  std::vector<std::string> all_gather(const std::string& text) override {
    const int own = static_cast<int>(text.size());
    std::vector<int> sizes(static_cast<std::size_t>(count_)), starts(sizes.size());
    MPI_Request request = MPI_REQUEST_NULL;
    MPI_Iallgather(&own, 1, MPI_INT, sizes.data(), 1, MPI_INT, MPI_COMM_WORLD, &request);
    wait(request);
    for (std::size_t r = 1; r < sizes.size(); ++r) starts[r] = starts[r - 1] + sizes[r - 1];
    std::string all(static_cast<std::size_t>(starts.back() + sizes.back()), '\0');
    MPI_Iallgatherv(text.data(), own, MPI_CHAR, all.data(), sizes.data(), starts.data(), MPI_CHAR, MPI_COMM_WORLD,
                    &request);
    wait(request);
    std::vector<std::string> texts;
    for (std::size_t r = 0; r < sizes.size(); ++r) {
      texts.push_back(all.substr(static_cast<std::size_t>(starts[r]), static_cast<std::size_t>(sizes[r])));
    }
    return texts;
  }

  std::vector<std::string> exchange(std::vector<std::string> to) override {
    std::vector<std::uint64_t> sent, received(to.size());
    for (const std::string& bytes : to) sent.push_back(bytes.size());
    MPI_Request request = MPI_REQUEST_NULL;
    MPI_Ialltoall(sent.data(), 1, MPI_UINT64_T, received.data(), 1, MPI_UINT64_T, MPI_COMM_WORLD, &request);
    wait(request);
    std::vector<std::string> from(to.size());
    std::vector<MPI_Request> requests;
    for (std::size_t r = 0; r < to.size(); ++r) {
      if (static_cast<int>(r) == rank_) continue;
      from[r].resize(received[r]);
      for_each_piece(from[r], [&](char* piece, int bytes) {
        MPI_Irecv(piece, bytes, MPI_CHAR, static_cast<int>(r), kExchangeTag, MPI_COMM_WORLD, &requests.emplace_back());
      });
      for_each_piece(to[r], [&](char* piece, int bytes) {
        MPI_Isend(piece, bytes, MPI_CHAR, static_cast<int>(r), kExchangeTag, MPI_COMM_WORLD, &requests.emplace_back());
      });
    }
    wait([&] {
      int done = 0;
      MPI_Testall(static_cast<int>(requests.size()), requests.data(), &done, MPI_STATUSES_IGNORE);
      return done != 0;
    });
    from[static_cast<std::size_t>(rank_)] = std::move(to[static_cast<std::size_t>(rank_)]);
    return from;
  }

 private:
  static constexpr int kExchangeTag = 1;

  /// MPI counts bytes by int. Pieces from one process to another arrive in order.
  template <class Work>
  static void for_each_piece(std::string& bytes, const Work& work) {
    constexpr std::size_t kMost = std::size_t{1} << 28;
    for (std::size_t begin = 0; begin < bytes.size(); begin += kMost)
      work(bytes.data() + begin, static_cast<int>(std::min(kMost, bytes.size() - begin)));
  }

  /// Waits without MPI's busy waiting, which occupies a core that others render on. Data moves while it is tested, so
  /// the pauses are short at first; those of a long wait are a small part of it.
  template <class IsDone>
  static void wait(const IsDone& is_done) {
    constexpr std::chrono::microseconds kShortest{20}, kLongest{10000};
    for (auto pause = kShortest; !is_done(); pause = std::min(kLongest, pause + pause / 16 + kShortest / 16))
      std::this_thread::sleep_for(pause);
  }
  static void wait(MPI_Request& request) {
    wait([&] {
      int done = 0;
      MPI_Test(&request, &done, MPI_STATUS_IGNORE);
      return done != 0;
    });
  }

  EndWatch end_watch_;  // created before MPI starts threads
  int rank_ = 0, count_ = 1;
};
#endif

}  // namespace

std::unique_ptr<jobs::Ranks> ranks_of_mpirun() {
  if (!is_started_by_mpirun()) return nullptr;
#ifdef TILEFLIGHT_MPI
  return std::make_unique<MpiRanks>();
#else
  throw InputError(
      "mpirun", "this tileflight was built without MPI: run a single process, or build with libopenmpi-dev installed");
#endif
}

nlohmann::json run_among_ranks(const std::function<nlohmann::json(jobs::Ranks*)>& work) {
  const std::unique_ptr<jobs::Ranks> ranks = ranks_of_mpirun();
  if (!ranks) return work(nullptr);
  try {
    return work(ranks.get());
  } catch (const jobs::CollectiveError&) {
    if (ranks->rank() == 0) throw;
    throw FailedElsewhere();
  } catch (const std::exception& fault) {
    if (ranks->count() == 1) throw;
    std::cerr << "tileflight: rank " + std::to_string(ranks->rank()) + ": " + fault.what() + "\n";
    abort_ranks();
  }
}

void let_first_rank_report() {
  constexpr std::chrono::seconds kAtMost{5};
  std::this_thread::sleep_for(kAtMost);
  std::_Exit(1);
}

void refuse_ranks() {
  if (told_by_mpirun("OMPI_COMM_WORLD_SIZE") < 2) return;
  if (told_by_mpirun("OMPI_COMM_WORLD_RANK") > 0) let_first_rank_report();
  throw InputError("mpirun",
                   "only `render` and `extract --block` share their work among processes; start this command once, "
                   "without mpirun or with `-n 1` (it uses all cores)");
}

void abort_ranks() {
#ifdef TILEFLIGHT_MPI
  MPI_Abort(MPI_COMM_WORLD, 1);
#endif
  std::_Exit(1);
}

int ranks_on_this_machine() { return std::max(1, told_by_mpirun("OMPI_COMM_WORLD_LOCAL_SIZE")); }

std::size_t threads_by_default() {
  const long cores = sysconf(_SC_NPROCESSORS_ONLN);
  const auto usable = static_cast<long>(std::max(1U, std::thread::hardware_concurrency()));
  const long share = std::max(1L, cores / ranks_on_this_machine());
  return static_cast<std::size_t>(std::min(usable, share));
}

}  // namespace tileflight::app
