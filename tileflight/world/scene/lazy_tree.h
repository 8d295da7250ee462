#pragma once

#include <tbb/task_arena.h>

#include <mutex>
#include <optional>

namespace tileflight::scene {

/// An object built on first use.
template <class Tree>
class LazyTree {
 public:
  template <class Build>
  const Tree& get(const Build& build) {
    std::call_once(once_, [&] { build_apart(build); });
    return *tree_;
  }

 private:
  /// Builds in an arena of its own, for two reasons. While this thread waits for parts of the tree, it must not pick up
  /// a task that needs the tree. And Embree's scene keeps a task group, whose context would be bound to that of the
  /// algorithm in which the tree happens to be built, and would refer to it after its end.
  template <class Build>
  void build_apart(const Build& build) {
    tbb::task_arena arena(tbb::this_task_arena::max_concurrency());
    arena.execute([&] { tree_.emplace(build()); });
  }

  std::once_flag once_;
  std::optional<Tree> tree_;
};

}  // namespace tileflight::scene
