// Threads that wait for a number of equal tasks and share them with the caller.
#pragma once

#include <atomic>
#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

class ThreadPool {
public:
    explicit ThreadPool(int threads) {
        try {
            for (int k = 1; k < threads; ++k) {
                m_threads.emplace_back([this] { serve(); });
            }
        } catch (...) {
            // The system allows no more threads: unless the running ones are joined, they would end the whole program.
            stop();
            throw;
        }
    }

    ~ThreadPool() { stop(); }

    // task(0) ... task(count - 1), each once, in any order; returns when all are done.
    void run(int count, const std::function<void(int)>& task) {
        {
            const std::lock_guard<std::mutex> lock(m_mutex);
            m_task = &task;
            m_count = count;
            m_next = 0;
            m_busy = static_cast<int>(m_threads.size());
            ++m_round;
        }
        m_wake.notify_all();
        work();
        std::unique_lock<std::mutex> lock(m_mutex);
        m_done.wait(lock, [this] { return m_busy == 0; });
        if (m_error) {
            std::rethrow_exception(std::exchange(m_error, nullptr));
        }
    }

private:
    std::vector<std::thread> m_threads;
    std::mutex m_mutex;
    std::condition_variable m_wake, m_done;
    const std::function<void(int)>* m_task = nullptr;
    std::atomic<int> m_next{0};
    int m_count = 0, m_busy = 0;
    unsigned long m_round = 0;
    bool m_stop = false;
    std::exception_ptr m_error;

    void stop() {
        {
            const std::lock_guard<std::mutex> lock(m_mutex);
            m_stop = true;
        }
        m_wake.notify_all();
        for (std::thread& thread : m_threads) {
            thread.join();
        }
    }

    void work() {
        try {
            for (int k = m_next++; k < m_count; k = m_next++) {
                (*m_task)(k);
            }
        } catch (...) {
            const std::lock_guard<std::mutex> lock(m_mutex);
            m_error = std::current_exception();
        }
    }

    void serve() {
        unsigned long seen = 0;
        std::unique_lock<std::mutex> lock(m_mutex);
        while (true) {
            m_wake.wait(lock, [&] { return m_stop || m_round != seen; });
            if (m_stop) {
                return;
            }
            seen = m_round;
            lock.unlock();
            work();
            lock.lock();
            if (--m_busy == 0) {
                m_done.notify_one();
            }
        }
    }
};
