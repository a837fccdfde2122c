// Threads that share out the work within one frame.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <type_traits>
#include <vector>

namespace harco::detect {

/// The caller's thread and others that sleep until there is something to share. Nothing is
/// allocated for sharing. What is shared must not depend on who does which part of it.
class Workers {
 public:
  /// The caller alone if there is one thread only. Throws std::system_error where the system has no
  /// more of them.
  explicit Workers(std::size_t threads = 1);
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;
  ~Workers();

  std::size_t count() const { return helpers_.size() + 1; }

  /// Into how many parts to cut what can be cut anywhere: one for the caller alone, otherwise some
  /// for each, so that nobody waits long for a slow one.
  std::size_t parts() const { return count() == 1 ? 1 : 4 * count(); }

  /// Calls `work(item, worker)` for every item below `items`, `worker` (below count()) being
  /// another one for each of the calls that run at the same time, and returns when all are done. An
  /// exception is passed on, and items that nobody has begun are left out then.
  template <typename Work>
  void share(std::size_t items, const Work& work) {
    run(items, {&work, [](const void* what, std::size_t item, std::size_t worker) {
                  (*static_cast<const Work*>(what))(item, worker);
                }});
  }

 private:
  struct Call {
    const void* work;
    void (*with)(const void* work, std::size_t item, std::size_t worker);
  };
  void run(std::size_t items, const Call& call);
  void help(std::size_t worker);
  void work_off(std::unique_lock<std::mutex>& lock, std::size_t worker);
  void dismiss();

  std::mutex mutex_;  // guards all of the following but the threads
  std::condition_variable begun_, done_;
  Call call_{};
  std::size_t next_ = 0, items_ = 0;
  std::size_t running_ = 0;  // items
  bool over_ = false;
  std::exception_ptr failure_;
  std::vector<std::thread> helpers_;
};

}  // namespace harco::detect
