#include "clratio/exception.hpp"

#include "opencl.hpp"

namespace clratio {

#define CLR_CODE(name)                                                                                                      \
    case name:                                                                                                              \
        return #name

const char* code_name(cl_int code) {
    switch (code) {
        CLR_CODE(CL_SUCCESS);
        CLR_CODE(CL_DEVICE_NOT_FOUND);
        CLR_CODE(CL_DEVICE_NOT_AVAILABLE);
        CLR_CODE(CL_COMPILER_NOT_AVAILABLE);
        CLR_CODE(CL_MEM_OBJECT_ALLOCATION_FAILURE);
        CLR_CODE(CL_OUT_OF_RESOURCES);
        CLR_CODE(CL_OUT_OF_HOST_MEMORY);
        CLR_CODE(CL_PROFILING_INFO_NOT_AVAILABLE);
        CLR_CODE(CL_MEM_COPY_OVERLAP);
        CLR_CODE(CL_BUILD_PROGRAM_FAILURE);
        CLR_CODE(CL_MAP_FAILURE);
        CLR_CODE(CL_MISALIGNED_SUB_BUFFER_OFFSET);
        CLR_CODE(CL_EXEC_STATUS_ERROR_FOR_EVENTS_IN_WAIT_LIST);
        CLR_CODE(CL_KERNEL_ARG_INFO_NOT_AVAILABLE);
        CLR_CODE(CL_INVALID_VALUE);
        CLR_CODE(CL_INVALID_DEVICE_TYPE);
        CLR_CODE(CL_INVALID_PLATFORM);
        CLR_CODE(CL_INVALID_DEVICE);
        CLR_CODE(CL_INVALID_CONTEXT);
        CLR_CODE(CL_INVALID_QUEUE_PROPERTIES);
        CLR_CODE(CL_INVALID_COMMAND_QUEUE);
        CLR_CODE(CL_INVALID_HOST_PTR);
        CLR_CODE(CL_INVALID_MEM_OBJECT);
        CLR_CODE(CL_INVALID_BINARY);
        CLR_CODE(CL_INVALID_BUILD_OPTIONS);
        CLR_CODE(CL_INVALID_PROGRAM);
        CLR_CODE(CL_INVALID_PROGRAM_EXECUTABLE);
        CLR_CODE(CL_INVALID_KERNEL_NAME);
        CLR_CODE(CL_INVALID_KERNEL_DEFINITION);
        CLR_CODE(CL_INVALID_KERNEL);
        CLR_CODE(CL_INVALID_ARG_INDEX);
        CLR_CODE(CL_INVALID_ARG_VALUE);
        CLR_CODE(CL_INVALID_ARG_SIZE);
        CLR_CODE(CL_INVALID_KERNEL_ARGS);
        CLR_CODE(CL_INVALID_WORK_DIMENSION);
        CLR_CODE(CL_INVALID_WORK_GROUP_SIZE);
        CLR_CODE(CL_INVALID_WORK_ITEM_SIZE);
        CLR_CODE(CL_INVALID_GLOBAL_OFFSET);
        CLR_CODE(CL_INVALID_EVENT_WAIT_LIST);
        CLR_CODE(CL_INVALID_EVENT);
        CLR_CODE(CL_INVALID_OPERATION);
        CLR_CODE(CL_INVALID_BUFFER_SIZE);
        CLR_CODE(CL_INVALID_GLOBAL_WORK_SIZE);
        CLR_CODE(CL_INVALID_PROPERTY);
    case -1001:
        return "CL_PLATFORM_NOT_FOUND_KHR";
    default:
        return "unknown OpenCL code";
    }
}

#undef CLR_CODE

DeviceError::DeviceError(std::string what_call, int what_code) : DeviceError(std::move(what_call), what_code, "") {}

DeviceError::DeviceError(std::string what_call, int what_code, const std::string& hint)
    : Error(what_call + " failed: " + code_name(what_code) + " (" + std::to_string(what_code) + ")" +
            (hint.empty() ? "" : ". " + hint)),
      call(std::move(what_call)), code(what_code) {}

}  // namespace clratio
