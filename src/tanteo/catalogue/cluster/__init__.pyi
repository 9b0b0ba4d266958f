from .own import own_processes as own_processes
from .work import at_work as at_work
from .work import check_scheduler as check_scheduler
from .work import run_tasks as run_tasks
