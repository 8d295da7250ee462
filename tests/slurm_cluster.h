#pragma once

#include <signal.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>

#include "tests/run_program.h"
#include "tests/temporary_folder.h"

namespace tileflight::tests {

/// Slurm's daemons on this machine with two nodes, n1 and n2, all of which end with the object. Its own ports and
/// files: a Slurm of the machine is not touched. Needs root, as Slurm's daemons do.
class SlurmCluster {
 public:
  static bool is_possible() {
    return geteuid() == 0 && std::system(
                                 "for program in slurmctld slurmd munged sbatch scontrol; do "
                                 "command -v $program > /dev/null || exit 1; done") == 0;
  }

  SlurmCluster() {
    std::filesystem::permissions(folder_.path(), std::filesystem::perms(0755));
    write("munge.key", std::string(64, 'k') + std::to_string(getpid()));
    std::filesystem::permissions(folder_ / "munge.key", std::filesystem::perms(0600));
    std::filesystem::create_directory(folder_ / "state");
    write("slurm.conf", configuration());
    // From version 24 on a node needs control groups that may be written, or this word, which earlier ones do not know.
    run("test \"$(slurmd -V | sed 's/[^0-9]*\\([0-9]*\\).*/\\1/')\" -lt 24 || "
        "echo CgroupPlugin=disabled > {}/cgroup.conf");
    run("munged --force --key-file={}/munge.key --socket={}/munge.socket --pid-file={}/munged.pid "
        "--log-file={}/munged.log --seed-file={}/munge.seed");
    run("slurmctld -f {}/slurm.conf");
    for (const char* node : {"n1", "n2"}) run(std::string("slurmd -N ") + node + " -f {}/slurm.conf");
    if (!wait_until("test \"$(sinfo -h -t idle -o %D)\" = 2"))
      throw std::runtime_error("Slurm's nodes do not come up: " + file_text(folder_ / "slurmctld.log"));
  }
  ~SlurmCluster() {
    try_to_run("scancel --state=PENDING; scancel --state=RUNNING");
    for (const char* file : {"slurmd-n1.pid", "slurmd-n2.pid", "slurmctld.pid", "munged.pid"}) stop(file, SIGTERM);
    std::this_thread::sleep_for(std::chrono::seconds(1));
    for (const char* file : {"slurmd-n1.pid", "slurmd-n2.pid", "slurmctld.pid"}) stop(file, SIGKILL);
  }
  SlurmCluster(const SlurmCluster&) = delete;
  SlurmCluster& operator=(const SlurmCluster&) = delete;

  /// "CI=true SLURM_CONF=…", for run_tileflight(). With CI=true Snakemake asks for its jobs' states every second in
  /// place of every ten (its executors' sleep()).
  std::string environment() const { return "CI=true SLURM_CONF=" + shell_quoted((folder_ / "slurm.conf").string()); }

  /// Selects how the controller learns that a node is dead: by half a minute of silence, or from a monitor.
  enum class Notice { kSilence, kMonitor };

  /// The node that runs a job loses its power: its daemon and all that it runs are killed. Returns the node's name;
  /// empty if no node runs anything.
  std::string kill_busy_node(Notice notice) const {
    try_to_run("squeue -h -t R -o %N | head -n 1 > {}/busy");
    std::string node = file_text(folder_ / "busy");
    while (!node.empty() && node.back() == '\n') node.pop_back();
    if (node.empty()) return "";
    stop("slurmd-" + node + ".pid", SIGKILL);
    // The job's processes know their node; their parent is the daemon's own process for the job.
    try_to_run("for p in $(grep -lzs '^SLURMD_NODENAME=" + node +
               "$' /proc/[0-9]*/environ | cut -d/ -f3); do grep -qzs '^SLURM_CONF={}/' /proc/$p/environ || continue; "
               "kill -9 $(awk '/^PPid/ {print $2}' /proc/$p/status) $p; done");
    if (notice == Notice::kMonitor) try_to_run("scontrol update NodeName=" + node + " State=DOWN Reason=power");
    return node;
  }

  /// A dead node comes back.
  void start_again(const std::string& node) const {
    run("slurmd -N " + node + " -f {}/slurm.conf");
    if (!wait_until("test \"$(sinfo -h -t idle -o %D)\" = 2"))
      throw std::runtime_error("the node does not come back: " + file_text(folder_ / ("slurmd-" + node + ".log")));
  }

  /// Lets the job of a dead node begin at once: Slurm would hold it back for two minutes.
  void hurry_requeued_job() const {
    if (wait_until("scontrol show job --oneliner | grep -q 'JobState=PENDING.*Restarts=[1-9]'"))
      try_to_run("for job in $(squeue -h -t PD -o %A); do scontrol update JobId=$job StartTime=now; done");
  }

 private:
  std::string configuration() const {
    const std::string folder = folder_.path(), port = std::to_string(20000 + getpid() % 20000);
    const auto nth_port = [&](int n) { return std::to_string(std::stoi(port) + n); };
    std::array<char, 256> host{};
    gethostname(host.data(), host.size() - 1);
    const std::string short_host = std::string(host.data()).substr(0, std::string(host.data()).find('.'));
    std::string nodes;
    for (int n = 1; n <= 2; ++n)
      nodes += "NodeName=n" + std::to_string(n) + " NodeHostname=" + short_host +
               " NodeAddr=127.0.0.1 Port=" + nth_port(n) + " CPUs=2 RealMemory=4500\n";
    return "ClusterName=tileflight\nSlurmctldHost=" + short_host + "(127.0.0.1)\nSlurmUser=root\nSlurmdUser=root\n" +
           "SlurmctldPort=" + port + "\nAuthType=auth/munge\nAuthInfo=socket=" + folder + "/munge.socket\n" +
           "CryptoType=crypto/munge\nStateSaveLocation=" + folder + "/state\nSlurmdSpoolDir=" + folder +
           "/spool-%n\nSlurmctldPidFile=" + folder + "/slurmctld.pid\nSlurmdPidFile=" + folder +
           "/slurmd-%n.pid\nSlurmctldLogFile=" + folder + "/slurmctld.log\nSlurmdLogFile=" + folder +
           "/slurmd-%n.log\nProctrackType=proctrack/pgid\nTaskPlugin=task/none\nSelectType=select/cons_tres\n" +
           "SelectTypeParameters=CR_Core\nReturnToService=2\nKillWait=1\nMpiDefault=none\nJobRequeue=1\n" +
           "SlurmdTimeout=5\n" +
           "SchedulerParameters=batch_sched_delay=0,sched_min_interval=0,sched_interval=1,bf_interval=1\n" + nodes +
           "PartitionName=all Nodes=n1,n2 Default=YES State=UP MaxTime=INFINITE\n";
  }

  void write(const std::string& name, const std::string& text) { std::ofstream(folder_ / name) << text; }

  bool try_to_run(std::string command) const {
    for (std::size_t at; (at = command.find("{}")) != std::string::npos;) command.replace(at, 2, folder_.path());
    return std::system((environment() + "; export SLURM_CONF; { " + command + "; } > /dev/null 2>&1").c_str()) == 0;
  }
  void run(const std::string& command) const {
    if (!try_to_run(command)) throw std::runtime_error("cannot start " + command.substr(0, command.find(' ')));
  }
  bool wait_until(const std::string& condition) const {
    for (int i = 0; i < 200; ++i) {
      if (try_to_run(condition)) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(300));
    }
    return false;
  }
  void stop(const std::string& pid_file, int signal) const {
    std::ifstream file(folder_ / pid_file);
    pid_t process = 0;
    if (file >> process && process > 1) kill(process, signal);
  }

  TemporaryFolder folder_;
};

}  // namespace tileflight::tests
